"""Matchers: a similarity matrix in, the reference of every window or frame out. One file each.

A new matcher is one file in this room: a class with the members of `Matcher`, a frozen dataclass
of parameters, and `register` above it. Nothing else needs to know.

- ``mean``: mean of the diagonal (`mean`);
- ``seqslam``, ``openseqslam2``: straight lines of several speeds (`straight` is what they share);
- ``dtw``, ``hmm``, ``graph``: paths of any speed (`evidence`, `motion`, `trails`);
- ``auto``: picks one of them from the drive's speed profile.
"""

from retraverse.matching.matchers.base import Answer, Matcher, OnlineMatcher
from retraverse.matching.matchers.registry import (
    MatcherInfo,
    describe_matcher,
    matcher,
    matchers,
    register,
)

__all__ = [
    "Answer",
    "Matcher",
    "MatcherInfo",
    "OnlineMatcher",
    "describe_matcher",
    "matcher",
    "matchers",
    "register",
]
