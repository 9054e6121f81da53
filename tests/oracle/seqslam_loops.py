"""SeqSLAM in plain loops, one cell after the other, as the published Python port does it.

Written from the method's description: it is slow, obvious, and shares nothing with ours.
"""

import math
from typing import Any

__all__ = ["enhance_loops", "match_loops", "search_loops"]


def enhance_loops(differences: list[list[float]], radius: int) -> list[list[float]]:
    """Enhance the contrast of every pair among its neighbouring references."""
    enhanced = []
    for row in differences:
        out = []
        for j in range(len(row)):
            window = row[max(0, j - radius) : j + radius + 1]
            mean = sum(window) / len(window)
            variance = sum((value - mean) ** 2 for value in window) / (len(window) - 1)
            out.append((row[j] - mean) / math.sqrt(variance))
        enhanced.append(out)
    least = min(min(row) for row in enhanced)
    return [[value - least for value in row] for row in enhanced]


def search_loops(
    enhanced: list[list[float]], first: int, ds: int, v_min: float, v_max: float, radius: int
) -> tuple[int, int, float, float]:
    """Return start, references passed, sum of the best line and of the best one elsewhere."""
    n = len(enhanced[0])
    scores, passed = [], []
    for start in range(n):
        best, best_move = math.inf, -1
        for move in range(math.ceil(v_min * ds - 1e-9), math.floor(v_max * ds + 1e-9) + 1):
            total = 0.0
            for t in range(ds + 1):
                reference = start + t * move // ds
                total += enhanced[first + t][reference] if reference < n else math.inf
            if total < best:
                best, best_move = total, move
        scores.append(best)
        passed.append(best_move)
    start = scores.index(min(scores))
    elsewhere = [score for j, score in enumerate(scores) if abs(j - start) > radius]
    return start, passed[start], scores[start], min(elsewhere, default=math.inf)


def match_loops(differences: Any, ds: int = 10) -> list[tuple[int, int, float]]:
    """Return the middle query, its slope-aware reference, and best / second best, per window."""
    enhanced = enhance_loops(differences.tolist(), 5)
    answers = []
    for first in range(len(enhanced) - ds):
        start, move, best, second = search_loops(enhanced, first, ds, 0.8, 1.2, 5)
        answers.append((first + ds // 2, start + ds // 2 * move // ds, best / second))
    return answers
