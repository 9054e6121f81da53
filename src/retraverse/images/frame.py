"""Placeholder, completed by the images room."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Frame:
    name: str
