"""Precision-recall curves, and the numbers read off them.

Three curves are in use in the field and all of them are called "the" precision-recall curve;
they differ in what is decided and in what recall is a share of:

========  ============================  ===================================================
name      decided                       recall's denominator
========  ============================  ===================================================
thesis    best match of each window     correct best matches (recall always reaches 1)
single    best match of each window     queries that have a true match
multi     each cell of the similarity   true cells
========  ============================  ===================================================

Conventions
- A match is *retrieved* at a threshold when its score is at least that threshold (ties together).
- Every distinct score is a threshold; `n_thresholds` asks for an even grid instead.
- Every curve starts at recall 0, precision 1, threshold +inf, where nothing is retrieved.
- Nothing correct: recall is 0 throughout, and so is every number read off the curve.
- Answers of "no match" are never retrieved: leave them out of `correct` and `score`.

Contents: `precision_recall_curve`, `cell_precision_recall_curve` -> `PrecisionRecall`;
`area_under_curve`, `average_precision`, `recall_at_full_precision`, `precision_at_full_recall`,
`extended_precision` read numbers off one.

The thesis: section 2.7.2, equations 2.1 (precision), 2.2 (recall), 2.3 (extended precision).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from retraverse.errors import ConfigError, InputError
from retraverse.metrics.cell_counts import CellCounts, count_cells
from retraverse.metrics.checks import Float64Array, cells, decisions
from retraverse.types import Array, IntArray

__all__ = [
    "PrecisionRecall",
    "area_under_curve",
    "average_precision",
    "cell_precision_recall_curve",
    "extended_precision",
    "precision_at_full_recall",
    "precision_recall_curve",
    "recall_at_full_precision",
]


@dataclass(frozen=True, eq=False)
class PrecisionRecall:
    """A precision-recall curve: one point per threshold, from strict to lenient.

    Point 0 is recall 0, precision 1, threshold +inf. Recall never falls along the curve.
    """

    recall: Float64Array
    """Share of `n_positives` that is retrieved (equation 2.2), shape (T + 1,), in [0, 1]."""
    precision: Float64Array
    """Share of what is retrieved that is correct (equation 2.1), shape (T + 1,), in [0, 1]."""
    threshold: Float64Array
    """Least score that is retrieved, shape (T + 1,), falling."""
    n_positives: int
    """Recall's denominator."""
    definition: str
    """``thesis``, ``single`` or ``multi``: see the head of this module."""


def precision_recall_curve(
    correct: ArrayLike,
    score: ArrayLike,
    *,
    n_positives: int | None = None,
    n_thresholds: int | None = None,
) -> PrecisionRecall:
    """Return the precision-recall curve over best matches.

    Parameters
    ----------
    correct : bool array, shape (W,)
        Whether the best match of each window is right. Leave out answers of "no match".
    score : float array, shape (W,)
        How sure each best match is, higher is better.
    n_positives : int, optional
        Recall's denominator: the number of queries that have a true match ("single"; the rule of
        VPR_Tutorial). Default: the number of correct best matches ("thesis"; the rule of
        VPR-Bench), with which a wrong best match never counts as a miss.
    n_thresholds : int of at least 2, optional
        So many thresholds, evenly from the highest score to the lowest, in place of every distinct
        score: VPR_Tutorial takes 100. Only for comparison: recall at full precision suffers.

    Returns
    -------
    PrecisionRecall
        One point per threshold after the point at recall 0, precision 1.

    Raises
    ------
    ShapeError
        If the shapes differ or `correct` is not bool.
    InputError
        If a score is NaN, or `n_positives` is less than the correct best matches.
    ConfigError
        If `n_thresholds` is below 2.

    Notes
    -----
    TP = correct matches retrieved, FP = wrong ones; precision = TP / (TP + FP) (equation 2.1),
    recall = TP / n_positives (equation 2.2). Equal scores enter together, as one point.
    Empty input gives the starting point alone.

    Examples
    --------
    >>> curve = precision_recall_curve([True, False, True], [0.9, 0.8, 0.7])
    >>> curve.recall.tolist()
    [0.0, 0.5, 0.5, 1.0]
    """
    is_right, scores = decisions(correct, score)
    n_correct = int(is_right.sum())
    if n_positives is not None and n_positives < n_correct:
        raise InputError(
            f"n_positives: got {n_positives}, but {n_correct} best matches are correct; "
            "expected the number of queries that have a true match"
        )
    ascending = np.sort(scores)
    ascending_right = np.sort(scores[is_right])
    thresholds = _thresholds(ascending, n_thresholds)
    return _curve(
        n_true=n_correct - np.searchsorted(ascending_right, thresholds, "left"),
        n_retrieved=scores.size - np.searchsorted(ascending, thresholds, "left"),
        threshold=thresholds,
        n_positives=n_correct if n_positives is None else n_positives,
        definition="thesis" if n_positives is None else "single",
    )


def cell_precision_recall_curve(
    similarity: ArrayLike, true_cells: ArrayLike, *, n_thresholds: int | None = None
) -> PrecisionRecall:
    """Return the precision-recall curve over all cells of a similarity matrix ("multi").

    Here every pair of frames is a decision of its own, so a place seen in five reference frames
    has to be found five times. VPR_Tutorial's ``matching="multi"``.

    Parameters
    ----------
    similarity : number array, shape (Q, R)
        Rows are queries, columns references, higher is better. It is read in blocks of rows and
        never copied whole.
    true_cells : bool array, shape (Q, R)
        Which pairs show the same place.
    n_thresholds : int of at least 2, optional
        As in `precision_recall_curve`.

    Returns
    -------
    PrecisionRecall
        Where recall stays the same over many thresholds, only the first and the last of them are
        kept: every number read off the curve is that of the full one.

    Raises
    ------
    ShapeError
        If the shapes differ or `true_cells` is not bool.
    InputError
        If a cell is NaN.
    ConfigError
        If `n_thresholds` is below 2.
    """
    scores, truth = cells(similarity, true_cells)
    true_scores = np.sort(scores[truth])
    if n_thresholds is None:
        counts = count_cells(scores, np.unique(true_scores))
        points = _points_around_true_cells(counts, true_scores)
    else:
        extremes = np.array([scores.min(), scores.max()]) if scores.size else np.array([])
        thresholds = _thresholds(extremes, n_thresholds)
        counts = count_cells(scores, thresholds[::-1])
        points = (thresholds, counts.n_at_least[::-1])
    thresholds, n_retrieved = points
    return _curve(
        n_true=true_scores.size - np.searchsorted(true_scores, thresholds, "left"),
        n_retrieved=n_retrieved,
        threshold=thresholds.astype(np.float64),
        n_positives=true_scores.size,
        definition="multi",
    )


def area_under_curve(curve: PrecisionRecall) -> float:
    """Return the area under a precision-recall curve by the trapezoid rule, in [0, 1] (AUC).

    The area depends on the curve's definition: print `curve.definition` beside it. Under "thesis"
    it can exceed the accuracy by far, since wrong best matches lower precision but not recall.
    """
    return float(np.trapezoid(curve.precision, curve.recall))


def average_precision(curve: PrecisionRecall) -> float:
    """Return the step sum of (recall - previous recall) x precision, in [0, 1] (AP).

    Unlike `area_under_curve` it draws no straight line between thresholds, on which no threshold
    lies. Under "thesis" it is scikit-learn's ``average_precision_score``.
    """
    return float(np.sum(np.diff(curve.recall) * curve.precision[1:]))


def recall_at_full_precision(curve: PrecisionRecall) -> float:
    """Return the largest recall at which precision is still 1 (R_P100, R@100P), in [0, 1].

    0 when the highest score belongs to a wrong match. Exact when every distinct score is a
    threshold. The thesis, section 2.7.2.
    """
    return float(curve.recall[curve.precision == 1].max())


def precision_at_full_recall(curve: PrecisionRecall) -> float:
    """Return the largest precision at which recall is 1 (P_R100, P@100R), in [0, 1].

    Under "thesis" it is the precision just when the last correct match has entered: a little above
    the accuracy where some wrong matches score lower still. 0 when recall never reaches 1.
    """
    return float(curve.precision[curve.recall == 1].max(initial=0.0))


def extended_precision(curve: PrecisionRecall) -> float:
    """Return (P_R0 + R_P100) / 2, in [0, 1] (EP; equation 2.3 of the thesis).

    P_R0 is the precision at the strictest threshold that retrieves anything, 0 if none does.
    R_P100 counts as 0 when P_R0 is below 1.

    References
    ----------
    Ferrarini et al., "Exploring Performance Bounds of Visual Place Recognition Using Extended
    Precision", IEEE Robotics and Automation Letters, 2020.
    """
    p_r0 = float(curve.precision[1]) if curve.precision.size > 1 else 0.0
    return (p_r0 + (recall_at_full_precision(curve) if p_r0 == 1 else 0.0)) / 2


def _thresholds(ascending: Array, n_thresholds: int | None) -> Float64Array:
    """Falling thresholds: all distinct values, or an even grid over their range."""
    if n_thresholds is not None and n_thresholds < 2:
        raise ConfigError(f"n_thresholds: got {n_thresholds}, expected an integer of at least 2")
    if n_thresholds is None or not ascending.size:
        return np.unique(ascending)[::-1].astype(np.float64)
    # In float64 even for float32 scores: the grid's inner points must not be rounded to scores.
    lowest, highest = float(ascending[0]), float(ascending[-1])
    if not (np.isfinite(lowest) and np.isfinite(highest)):
        raise InputError(
            f"score: the range {lowest} to {highest} has no even grid of thresholds; "
            "expected finite scores, or no n_thresholds"
        )
    return np.linspace(highest, lowest, n_thresholds)


def _points_around_true_cells(counts: CellCounts, true_scores: Array) -> tuple[Array, IntArray]:
    """Thresholds at, and just before, every score of a true cell, and the lowest; with counts.

    Recall changes at no other threshold, so the rest of the curve runs straight down between them.
    """
    distinct = np.unique(true_scores)
    threshold = np.concatenate([distinct, counts.next_above, [counts.lowest]])
    n_retrieved = np.concatenate([counts.n_at_least, counts.n_above, [counts.n_cells]])
    # The point before the highest score retrieves nothing; others may coincide with a score.
    n_retrieved, first = np.unique(n_retrieved, return_index=True)
    kept = n_retrieved > 0
    return threshold[first][kept], n_retrieved[kept].astype(np.int64)


def _curve(
    *,
    n_true: IntArray,
    n_retrieved: IntArray,
    threshold: Float64Array,
    n_positives: int,
    definition: str,
) -> PrecisionRecall:
    """Divide the counts and put the starting point in front."""
    return PrecisionRecall(
        recall=np.concatenate([[0.0], n_true / max(1, n_positives)]),
        precision=np.concatenate([[1.0], n_true / n_retrieved]),
        threshold=np.concatenate([[np.inf], threshold]),
        n_positives=n_positives,
        definition=definition,
    )
