"""All numbers of one run at once: matches against ground truth.

Conventions
- A window answers for its first frame: match (query i, reference j) is judged as the pair i -> j,
  whatever its sequence length.
- Reference -1 means "no match". It is right when the query truly has none, and is never retrieved
  on a precision-recall curve. A best match for a query that truly has none is wrong.
- Queries that begin no window (the tail of the traverse) are unanswered.
- A share of nothing is NaN (accuracy over no windows); numbers read off a curve are 0 where
  nothing is correct.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from retraverse.errors import InputError, ShapeError
from retraverse.metrics.bootstrap import Interval, bootstrap_interval
from retraverse.metrics.definitions import DEFINITIONS
from retraverse.metrics.precision_recall import (
    PrecisionRecall,
    area_under_curve,
    average_precision,
    cell_precision_recall_curve,
    extended_precision,
    precision_at_full_recall,
    precision_recall_curve,
    recall_at_full_precision,
)
from retraverse.metrics.recall import RecallAt, recall_at
from retraverse.types import Array, BoolArray, IntArray

__all__ = ["Evaluation", "MatchesLike", "TruthLike", "evaluate"]


class MatchesLike(Protocol):
    """What `evaluate` reads of `retraverse.matching.Matches`; arrays of one shape (W,)."""

    @property
    def query(self) -> IntArray:
        """First frame of each window, no two the same."""

    @property
    def reference(self) -> IntArray:
        """First frame of the matched window; -1 = answered "no match"."""

    @property
    def score(self) -> Array:
        """How sure the match is, higher is better."""

    @property
    def sequence_length(self) -> IntArray:
        """Frames in each window."""

    @property
    def n_queries(self) -> int:
        """Frames of the query traverse."""

    @property
    def n_references(self) -> int:
        """Frames of the map."""


class TruthLike(Protocol):
    """What `evaluate` reads of `retraverse.datasets.GroundTruth`."""

    @property
    def n_queries(self) -> int:
        """Queries the truth is known for."""

    @property
    def description(self) -> str:
        """Where the truth comes from and what it tolerates."""

    def bounded(self, n_references: int) -> "TruthLike":
        """Return the truth for a map of so many references, or raise InputError."""

    def has_match(self) -> BoolArray:
        """Whether each query has a true match, shape (Q,)."""

    def is_correct(self, query: IntArray, reference: IntArray) -> BoolArray:
        """Whether each pair shows one place; for reference -1, whether the query has no match."""

    def matrix(self, n_references: int) -> BoolArray:
        """All true cells, shape (Q, R)."""


@dataclass(frozen=True, eq=False)
class Evaluation:
    """How good the matches of one run are; `definitions` says what each number means."""

    correct: BoolArray
    """Whether each window was answered correctly, shape (W,), in the order of the matches."""
    accuracy_interval: Interval
    """95 % bootstrap interval of `accuracy` over the windows."""
    curve: PrecisionRecall
    """Precision-recall over best matches, recall over the correct ones ("thesis")."""
    curve_single: PrecisionRecall
    """Precision-recall over best matches, recall over the queries with a true match ("single")."""
    curve_multi: PrecisionRecall | None
    """Precision-recall over the cells of the similarity matrix ("multi"); None without it."""
    recall_at: Mapping[int, float] | None
    """N -> Recall@N over all queries; None without the similarity matrix."""
    recall_at_with_match: Mapping[int, float] | None
    """N -> Recall@N over the queries that have a true match; None without the matrix."""
    n_queries: int
    """Frames of the query traverse."""
    n_references: int
    """Frames of the map."""
    n_refused: int
    """Windows answered "no match"."""
    n_with_match: int
    """Queries that have a true match."""
    mean_sequence_length: float
    """Mean K of the windows; NaN if there are none."""
    truth: str
    """Where the ground truth comes from and what it tolerates."""
    definitions: Mapping[str, str]
    """Name of a number -> one sentence that defines it."""

    @property
    def n_answered(self) -> int:
        """Windows answered, W, "no match" included."""
        return len(self.correct)

    @property
    def n_unanswered(self) -> int:
        """Queries that begin no window."""
        return self.n_queries - self.n_answered

    @property
    def n_correct(self) -> int:
        """Windows answered correctly, right refusals included."""
        return int(self.correct.sum())

    @property
    def accuracy(self) -> float:
        """Correct answers / windows answered (equation 2.5); NaN if nothing was answered."""
        return self.n_correct / self.n_answered if self.n_answered else math.nan

    @property
    def accuracy_all_queries(self) -> float:
        """Correct answers / all queries, unanswered ones being wrong; NaN if there are none."""
        return self.n_correct / self.n_queries if self.n_queries else math.nan

    @property
    def auc(self) -> float:
        """Area under `curve`: the thesis' definition."""
        return area_under_curve(self.curve)

    @property
    def auc_single(self) -> float:
        """Area under `curve_single`: denominator = queries that have a true match."""
        return area_under_curve(self.curve_single)

    @property
    def auc_multi(self) -> float | None:
        """Area under `curve_multi`: every cell a decision; None without the similarity matrix."""
        return None if self.curve_multi is None else area_under_curve(self.curve_multi)

    @property
    def average_precision(self) -> float:
        """Step sum under `curve`."""
        return average_precision(self.curve)

    @property
    def p_r100(self) -> float:
        """Largest precision at which `curve` has recall 1."""
        return precision_at_full_recall(self.curve)

    @property
    def r_p100(self) -> float:
        """Largest recall at which `curve` has precision 1."""
        return recall_at_full_precision(self.curve)

    @property
    def r_p100_single(self) -> float:
        """Largest recall at which `curve_single` has precision 1."""
        return recall_at_full_precision(self.curve_single)

    @property
    def ep(self) -> float:
        """Extended precision of `curve` (equation 2.3)."""
        return extended_precision(self.curve)

    @property
    def precision(self) -> Array:
        """Precision along `curve`, shape (T + 1,)."""
        return self.curve.precision

    @property
    def recall(self) -> Array:
        """Recall along `curve`, shape (T + 1,)."""
        return self.curve.recall

    @property
    def thresholds(self) -> Array:
        """Thresholds along `curve`, shape (T + 1,); the first is +inf."""
        return self.curve.threshold

    def to_dict(self) -> dict[str, Any]:
        """Return every number but the arrays, ready for JSON; NaN becomes None."""
        plain = {name: _plain(getattr(self, name)) for name in self.definitions}
        return {**plain, "definitions": dict(self.definitions)}


def evaluate(
    matches: MatchesLike,
    truth: TruthLike,
    *,
    similarity: Array | None = None,
    seed: int = 0,
    n_resamples: int = 2000,
) -> Evaluation:
    """Judge `matches` against `truth` by every metric of section 2.7.2 of the thesis.

    Parameters
    ----------
    matches : Matches
        One answer per window.
    truth : GroundTruth
        Of the same queries and references.
    similarity : number array, shape (Q, R), optional
        The single-frame similarity matrix, higher is better: needed for `auc_multi` and Recall@N.
    seed, n_resamples : int
        Of the bootstrap interval.

    Returns
    -------
    Evaluation
        Numbers, curves, counts, and the definition of each.

    Raises
    ------
    InputError
        If matches and truth are of different traverses, or the score of a best match is NaN. The
        scores of "no match" answers are not read.
    ShapeError
        If the arrays of `matches` differ in shape, or `similarity` is not (Q, R).
    """
    _check_matches(matches)
    truth = _truth_of_these(matches, truth)
    correct = truth.is_correct(matches.query, matches.reference)
    retrieved = matches.reference >= 0
    n_with_match = int(truth.has_match().sum())
    decided = correct[retrieved], matches.score[retrieved]
    curve_multi, recalls = _cell_metrics(matches, truth, similarity)
    return Evaluation(
        correct=correct,
        accuracy_interval=bootstrap_interval(correct, seed=seed, n_resamples=n_resamples),
        curve=precision_recall_curve(*decided),
        curve_single=precision_recall_curve(*decided, n_positives=n_with_match),
        curve_multi=curve_multi,
        recall_at=None if recalls is None else recalls.all_queries,
        recall_at_with_match=None if recalls is None else recalls.with_match,
        n_queries=matches.n_queries,
        n_references=matches.n_references,
        n_refused=int((~retrieved).sum()),
        n_with_match=n_with_match,
        mean_sequence_length=_mean(matches.sequence_length),
        truth=truth.description,
        definitions=DEFINITIONS,
    )


def _mean(values: IntArray) -> float:
    return float(values.mean()) if values.size else math.nan


def _check_matches(matches: MatchesLike) -> None:
    """Raise unless the arrays belong together and stay within the traverses."""
    shape = matches.query.shape
    for name in ("reference", "score", "sequence_length"):
        got = getattr(matches, name).shape
        if got != shape or len(shape) != 1:
            raise ShapeError(f"matches.{name}: got shape {got}, expected {shape} as matches.query")
    if np.unique(matches.query).size < matches.query.size:
        raise InputError("matches.query: some queries are answered twice; expected each once")
    _check_range("matches.query", matches.query, 0, matches.n_queries)
    _check_range("matches.reference", matches.reference, -1, matches.n_references)


def _check_range(name: str, index: IntArray, low: int, end: int) -> None:
    outside = index[(index < low) | (index >= end)]
    if outside.size:
        raise InputError(f"{name}: got frame {outside[0]}, expected {low} to {end - 1}")


def _truth_of_these(matches: MatchesLike, truth: TruthLike) -> TruthLike:
    """Return the truth bounded to the map, or raise if it is of another query traverse."""
    if truth.n_queries != matches.n_queries:
        raise InputError(
            f"ground truth: it is of {truth.n_queries} queries, the matches are of "
            f"{matches.n_queries}; expected the same traverse (were frames skipped or thinned? "
            "then select the same ones from the ground truth)"
        )
    return truth.bounded(matches.n_references)


def _cell_metrics(
    matches: MatchesLike, truth: TruthLike, similarity: Array | None
) -> tuple[PrecisionRecall | None, RecallAt | None]:
    """Metrics of the whole matrix, or None for both where there is no matrix."""
    if similarity is None:
        return None, None
    expected = (matches.n_queries, matches.n_references)
    if similarity.shape != expected:
        raise ShapeError(
            f"similarity: got shape {similarity.shape}, expected {expected}, queries x references"
        )
    true_cells = truth.matrix(matches.n_references)
    curve = cell_precision_recall_curve(similarity, true_cells)
    return curve, recall_at(similarity, true_cells)


def _plain(value: Any) -> Any:
    """Return `value` as JSON has it."""
    if isinstance(value, Interval):
        return {name: _plain(part) for name, part in value.to_dict().items()}
    if isinstance(value, Mapping):
        return {str(name): _plain(part) for name, part in value.items()}
    return None if isinstance(value, float) and math.isnan(value) else value
