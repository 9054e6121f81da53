import json
import math
import pickle
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from retraverse.datasets import aligned, from_positives
from retraverse.errors import InputError, ShapeError
from retraverse.metrics import Evaluation, evaluate
from retraverse.types import FloatArray, IntArray


def numbers(*values: int) -> IntArray:
    return np.array(values, np.int64)


@dataclass(frozen=True)
class Answers:
    """Five windows of two frames over six queries: right, wrong, refused, right, wrong."""

    query: IntArray = field(default_factory=lambda: numbers(0, 1, 2, 3, 4))
    reference: IntArray = field(default_factory=lambda: numbers(0, 5, -1, 3, 0))
    score: FloatArray = field(
        default_factory=lambda: np.array([0.9, 0.8, 0.1, 0.7, 0.6], np.float32)
    )
    sequence_length: IntArray = field(default_factory=lambda: np.full(5, 2))
    n_queries: int = 6
    n_references: int = 6


NOBODY = Answers(numbers(), numbers(), np.zeros(0, np.float32), numbers())
TRUTH = from_positives([[0], [1], [], [3], [4], [5]], 6, description="by hand")


def test_numbers_worked_out_by_hand() -> None:
    result = evaluate(Answers(), TRUTH)
    assert result.correct.tolist() == [True, False, True, True, False]
    assert result.accuracy == 3 / 5, "a refusal is right where there is no true match"
    assert result.accuracy_all_queries == 3 / 6
    # The curve runs over right, wrong, right, wrong: the refusal is never retrieved.
    np.testing.assert_allclose(result.recall, [0, 1 / 2, 1 / 2, 1, 1])
    np.testing.assert_allclose(result.precision, [1, 1, 1 / 2, 2 / 3, 1 / 2])
    np.testing.assert_allclose(result.thresholds, [np.inf, 0.9, 0.8, 0.7, 0.6], rtol=1e-6)
    assert result.auc == pytest.approx(1 / 2 + 1 / 2 * (1 / 2 + 2 / 3) / 2)
    assert result.auc_single == pytest.approx(result.auc * 2 / 5), "five queries have a match"
    assert result.average_precision == pytest.approx(1 / 2 + 1 / 2 * 2 / 3)
    assert result.p_r100 == pytest.approx(2 / 3)
    assert result.r_p100 == 1 / 2
    assert result.r_p100_single == 1 / 5
    assert result.ep == 3 / 4
    counts = (result.n_queries, result.n_answered, result.n_unanswered, result.n_refused)
    assert counts == (6, 5, 1, 1)
    assert (result.n_correct, result.n_with_match, result.n_references) == (3, 5, 6)
    assert result.mean_sequence_length == 2
    assert result.truth == "by hand"


def test_a_refusal_is_wrong_where_there_is_a_match_and_a_match_where_there_is_none() -> None:
    answers = replace(Answers(), reference=numbers(-1, 5, 2, 3, 0))
    assert evaluate(answers, TRUTH).correct.tolist() == [False, False, False, True, False]


def test_without_a_matrix_its_metrics_are_none() -> None:
    result = evaluate(Answers(), TRUTH)
    assert result.auc_multi is None
    assert result.curve_multi is None
    assert result.recall_at is None
    assert result.recall_at_with_match is None


def test_with_a_matrix() -> None:
    result = evaluate(Answers(), TRUTH, similarity=np.eye(6, dtype=np.float32))
    # Five of the six ones on the diagonal are true cells: precision 5/6 at recall 1.
    assert result.auc_multi == pytest.approx((1 + 5 / 6) / 2)
    # N = 10 and 20 are more than the map has.
    assert result.recall_at == {1: 5 / 6, 5: 5 / 6}
    assert result.recall_at_with_match == {1: 1.0, 5: 1.0}


def test_interval_holds_the_accuracy_and_records_its_seed() -> None:
    result = evaluate(Answers(), TRUTH, seed=3, n_resamples=500)
    interval = result.accuracy_interval
    assert interval.low <= result.accuracy <= interval.high
    assert (interval.seed, interval.n_resamples, interval.level) == (3, 500, 0.95)


def test_truth_that_runs_past_the_map_is_cut() -> None:
    overlong = from_positives([[0], [1], [], [3], [4], [6, 7]])
    result = evaluate(Answers(), overlong)
    assert result.n_with_match == 4
    assert "2 positives past the last of 6 references dropped" in result.truth


def test_no_windows() -> None:
    result = evaluate(NOBODY, TRUTH)
    assert math.isnan(result.accuracy)
    assert math.isnan(result.mean_sequence_length)
    assert math.isnan(result.accuracy_interval.low)
    assert result.accuracy_all_queries == 0
    assert result.n_unanswered == 6
    assert result.auc == result.auc_single == result.ep == result.p_r100 == 0
    plain = result.to_dict()
    assert plain["accuracy"] is None
    assert plain["accuracy_interval"]["low"] is None


def test_only_refusals() -> None:
    answers = replace(Answers(), reference=np.full(5, -1))
    result = evaluate(answers, TRUTH)
    assert result.accuracy == 1 / 5
    assert result.n_refused == 5
    assert result.recall.tolist() == [0]
    assert result.auc == 0


def test_no_queries_at_all() -> None:
    result = evaluate(replace(NOBODY, n_queries=0), aligned(0, 6))
    assert math.isnan(result.accuracy_all_queries)


def test_one_query() -> None:
    one = Answers(numbers(0), numbers(0), np.ones(1, np.float32), numbers(1), 1, 1)
    result = evaluate(one, aligned(1, 1), similarity=np.ones((1, 1), np.float32))
    assert result.accuracy == result.auc == result.auc_single == result.auc_multi == 1
    assert result.recall_at == {1: 1.0}


def test_constant_scores_are_one_point() -> None:
    result = evaluate(replace(Answers(), score=np.ones(5, np.float32)), TRUTH)
    assert result.recall.tolist() == [0, 1]
    assert result.precision.tolist() == [1, 0.5]
    assert result.ep == 0.25


def test_scores_of_refusals_are_not_read() -> None:
    score = np.array([0.9, 0.8, np.nan, 0.7, 0.6], np.float32)
    assert evaluate(replace(Answers(), score=score), TRUTH).auc == evaluate(Answers(), TRUTH).auc


def test_every_number_has_a_definition_and_goes_to_json() -> None:
    result = evaluate(Answers(), TRUTH, similarity=np.eye(6, dtype=np.float32))
    plain = json.loads(json.dumps(result.to_dict(), allow_nan=False))
    assert plain.pop("definitions") == dict(result.definitions)
    assert plain.keys() == result.definitions.keys()
    public = {name for name in dir(Evaluation) if not name.startswith("_")}
    public |= set(Evaluation.__dataclass_fields__)
    arrays = {"correct", "curve", "curve_single", "curve_multi", "precision", "recall"}
    assert public - arrays - {"thresholds", "definitions", "to_dict"} == plain.keys()
    assert all(text.endswith(".") for text in result.definitions.values())
    assert plain["auc"] == result.auc
    assert plain["recall_at"] == {"1": 5 / 6, "5": 5 / 6}
    for name in ("auc", "auc_single", "auc_multi"):
        kind = name.removeprefix("auc_") if name != "auc" else "thesis"
        assert f'"{kind}"' in result.definitions[name]


def test_a_result_travels_between_processes() -> None:
    result = pickle.loads(pickle.dumps(evaluate(Answers(), TRUTH)))
    assert result.accuracy == 3 / 5


@pytest.mark.parametrize(
    ("change", "error", "words"),
    [
        ({"score": np.full(5, np.nan)}, InputError, "4 of 4 are NaN"),
        ({"score": np.ones(4)}, ShapeError, r"matches.score: got shape \(4,\)"),
        ({"reference": np.ones((5, 1), int)}, ShapeError, "matches.reference: got shape"),
        ({"query": numbers(0, 1, 2, 3, 3)}, InputError, "answered twice"),
        ({"query": numbers(0, 1, 2, 3, 6)}, InputError, "query: got frame 6, expected 0 to 5"),
        ({"reference": np.full(5, 6)}, InputError, "reference: got frame 6, expected -1 to 5"),
        ({"reference": np.full(5, -2)}, InputError, "reference: got frame -2"),
        ({"n_queries": 7}, InputError, "of 6 queries, the matches are of 7.*thinned"),
        ({"n_references": 7}, InputError, "of 6 references, the map has 7"),
    ],
)
def test_bad_matches(change: dict[str, IntArray], error: type[Exception], words: str) -> None:
    with pytest.raises(error, match=words):
        evaluate(replace(Answers(), **change), TRUTH)  # type: ignore[arg-type]


def test_matrix_of_another_shape() -> None:
    with pytest.raises(ShapeError, match=r"got shape \(6, 5\), expected \(6, 6\)"):
        evaluate(Answers(), TRUTH, similarity=np.ones((6, 5)))
