"""Matching: which frame of the map each frame, or window of frames, of the query belongs to.

Conventions
- ``similarity[query, reference]``, higher is more alike.
- A window is named by its first query frame and answered by the first reference frame; a matcher
  for which it is another frame (`matchers`) says so.
- -1 is the answer "no match"; a query frame that starts no window has no answer at all.
"""

from retraverse.matching.balance import RunningBalance, balance
from retraverse.matching.calibrated_length import (
    calibrate_growth,
    calibrated_windows,
    describe_entropy,
    ensure_entropy,
    with_entropy,
)
from retraverse.matching.dynamic_length import GrowthRule, Window, dynamic_windows
from retraverse.matching.fusion import FusionMode, fuse, uniqueness
from retraverse.matching.match_traverse import SequenceLength, match, match_similarity
from retraverse.matching.matchers import Matcher, OnlineMatcher
from retraverse.matching.matches import NO_MATCH, Matches
from retraverse.matching.matches_file import load_matches, save_matches
from retraverse.matching.pairwise import describe_query, similarity
from retraverse.matching.region_masks import (
    RegionMask,
    learn_region_mask,
    masked,
    masked_map,
)

__all__ = [
    "NO_MATCH",
    "FusionMode",
    "GrowthRule",
    "Matcher",
    "Matches",
    "OnlineMatcher",
    "RegionMask",
    "RunningBalance",
    "SequenceLength",
    "Window",
    "balance",
    "calibrate_growth",
    "calibrated_windows",
    "describe_entropy",
    "describe_query",
    "dynamic_windows",
    "ensure_entropy",
    "fuse",
    "learn_region_mask",
    "load_matches",
    "masked",
    "masked_map",
    "match",
    "match_similarity",
    "save_matches",
    "similarity",
    "uniqueness",
    "with_entropy",
]
