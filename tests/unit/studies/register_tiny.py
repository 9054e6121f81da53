"""Registers the tests' technique when imported, as a user's own module would."""

from tests.unit.studies.tiny import Tiny, TinyParameters

from retraverse.techniques.registry import register

register(TinyParameters)(Tiny)
