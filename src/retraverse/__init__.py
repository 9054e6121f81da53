"""Where on a known route a camera is now, although season, light and viewpoint have changed.

>>> import retraverse as rt
>>> reference = rt.open_traverse("autumn/")
>>> query = rt.open_traverse("snow/")
>>> route = rt.build_map(reference, rt.technique("convsequential"))
>>> matches = rt.match(query, route, sequence_length="dynamic")
>>> rt.evaluate(matches, rt.aligned(len(query), len(reference), tolerance=2)).accuracy

The verbs below are the whole tutorial; each room of the package offers more. They are imported
when first used, so that ``import retraverse`` costs little.
"""

import importlib
from typing import TYPE_CHECKING, Any

from retraverse._version import __version__

if TYPE_CHECKING:
    from retraverse.datasets import GroundTruth, aligned, from_positions, ground_truth
    from retraverse.images import Frame, Traverse, open_traverse
    from retraverse.maps import RouteMap, build_map, load_map
    from retraverse.matching import Matcher, Matches, match, match_similarity, similarity
    from retraverse.matching.matchers import matcher, matchers
    from retraverse.metrics import Evaluation, evaluate
    from retraverse.techniques import (
        Technique,
        technique,
        technique_from_callable,
        techniques,
    )

__all__ = [
    "Evaluation",
    "Frame",
    "GroundTruth",
    "Matcher",
    "Matches",
    "RouteMap",
    "Technique",
    "Traverse",
    "__version__",
    "aligned",
    "build_map",
    "evaluate",
    "from_positions",
    "ground_truth",
    "load_map",
    "match",
    "match_similarity",
    "matcher",
    "matchers",
    "open_traverse",
    "similarity",
    "technique",
    "technique_from_callable",
    "techniques",
]

_ROOMS = {
    "datasets": ("GroundTruth", "aligned", "from_positions", "ground_truth"),
    "images": ("Frame", "Traverse", "open_traverse"),
    "maps": ("RouteMap", "build_map", "load_map"),
    "matching": ("Matcher", "Matches", "match", "match_similarity", "similarity"),
    "matching.matchers": ("matcher", "matchers"),
    "metrics": ("Evaluation", "evaluate"),
    "techniques": ("Technique", "technique", "technique_from_callable", "techniques"),
}
_HOMES = {name: room for room, names in _ROOMS.items() for name in names}


def __getattr__(name: str) -> Any:
    """Import a verb from its room when it is first used."""
    if name not in _HOMES:
        raise AttributeError(f"module 'retraverse' has no attribute {name!r}")
    return getattr(importlib.import_module(f"retraverse.{_HOMES[name]}"), name)


def __dir__() -> list[str]:
    return sorted(__all__)
