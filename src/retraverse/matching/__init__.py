"""Matching: which frame of the map each frame, or window of frames, of the query belongs to.

Conventions
- ``similarity[query, reference]``, higher is more alike.
- A window is named by its first query frame and answered by the first reference frame; a matcher
  for which it is another frame (`matchers`) says so.
- -1 is the answer "no match"; a query frame that starts no window has no answer at all.
"""

from retraverse.matching.dynamic_length import GrowthRule, Window, dynamic_windows
from retraverse.matching.match_traverse import SequenceLength, match, match_similarity
from retraverse.matching.matchers import Matcher, OnlineMatcher
from retraverse.matching.matches import NO_MATCH, Matches
from retraverse.matching.matches_file import load_matches, save_matches
from retraverse.matching.pairwise import describe_query, similarity

__all__ = [
    "NO_MATCH",
    "GrowthRule",
    "Matcher",
    "Matches",
    "OnlineMatcher",
    "SequenceLength",
    "Window",
    "describe_query",
    "dynamic_windows",
    "load_matches",
    "match",
    "match_similarity",
    "save_matches",
    "similarity",
]
