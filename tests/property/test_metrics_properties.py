"""What must hold of the metrics and ground truths whatever the answers are."""

from dataclasses import dataclass

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from retraverse.datasets import GroundTruth, from_positives
from retraverse.metrics import (
    PrecisionRecall,
    area_under_curve,
    average_precision,
    cell_precision_recall_curve,
    evaluate,
    extended_precision,
    performance_per_compute_unit,
    precision_at_full_recall,
    precision_recall_curve,
    recall_at,
    recall_at_full_precision,
    true_match_rank,
)
from retraverse.types import BoolArray, FloatArray, IntArray

NUMBERS = (
    area_under_curve,
    average_precision,
    precision_at_full_recall,
    recall_at_full_precision,
    extended_precision,
)


@dataclass(frozen=True)
class Answers:
    query: IntArray
    reference: IntArray
    score: FloatArray
    sequence_length: IntArray
    n_queries: int
    n_references: int


@st.composite
def best_matches(draw: st.DrawFn, least: int = 0) -> tuple[BoolArray, FloatArray]:
    """Answers with many equal scores: eighths, so that scaling by powers of two is exact."""
    pairs = draw(st.lists(st.tuples(st.booleans(), st.integers(-20, 20)), min_size=least))
    correct = np.array([pair[0] for pair in pairs], bool)
    return correct, np.array([pair[1] / 8 for pair in pairs], np.float32)


@st.composite
def matrices(draw: st.DrawFn) -> tuple[FloatArray, BoolArray]:
    n_queries, n_references = draw(st.integers(1, 7)), draw(st.integers(1, 7))
    n_cells = n_queries * n_references
    scores = draw(st.lists(st.integers(0, 9), min_size=n_cells, max_size=n_cells))
    truth = draw(st.lists(st.booleans(), min_size=n_cells, max_size=n_cells))
    shape = (n_queries, n_references)
    return np.array(scores, np.float32).reshape(shape), np.array(truth, bool).reshape(shape)


@st.composite
def runs(draw: st.DrawFn) -> tuple[Answers, GroundTruth]:
    """Some answers to some queries, "no match" among them, and a truth with gaps."""
    n_queries, n_references = draw(st.integers(1, 8)), draw(st.integers(1, 8))
    frames = st.lists(st.integers(0, n_references - 1), max_size=3)
    truth = from_positives(
        draw(st.lists(frames, min_size=n_queries, max_size=n_queries)), n_references
    )
    query = np.array(draw(st.permutations(range(n_queries))), np.int64)
    query = query[: draw(st.integers(0, n_queries))]

    def per_window(low: int, high: int) -> IntArray:
        size = len(query)
        values = draw(st.lists(st.integers(low, high), min_size=size, max_size=size))
        return np.array(values, np.int64)

    return Answers(
        query=query,
        reference=per_window(-1, n_references - 1),
        score=per_window(0, 5).astype(np.float32),
        sequence_length=per_window(1, 25),
        n_queries=n_queries,
        n_references=n_references,
    ), truth


def check_curve(curve: PrecisionRecall) -> None:
    assert (curve.recall[0], curve.precision[0], curve.threshold[0]) == (0, 1, np.inf)
    assert (np.diff(curve.recall) >= 0).all()
    assert (np.diff(curve.threshold) < 0).all()
    for axis in (curve.recall, curve.precision):
        assert ((axis >= 0) & (axis <= 1)).all()
    assert all(0 <= number(curve) <= 1 + 1e-12 for number in NUMBERS)


@given(best_matches(), st.integers(0, 5))
def test_every_curve_is_a_curve(answers: tuple[BoolArray, FloatArray], missed: int) -> None:
    check_curve(precision_recall_curve(*answers))
    check_curve(precision_recall_curve(*answers, n_positives=int(answers[0].sum()) + missed))


@given(matrices())
def test_every_curve_over_cells_is_a_curve(matrix: tuple[FloatArray, BoolArray]) -> None:
    check_curve(cell_precision_recall_curve(*matrix))


@given(matrices())
def test_curve_over_cells_gives_the_numbers_of_the_full_curve(
    matrix: tuple[FloatArray, BoolArray],
) -> None:
    similarity, truth = matrix
    thinned = cell_precision_recall_curve(similarity, truth)
    full = precision_recall_curve(truth.ravel(), similarity.ravel())
    for number in NUMBERS:
        np.testing.assert_allclose(number(thinned), number(full), atol=1e-12)


@given(best_matches(least=1))
def test_thesis_recall_reaches_1_and_precision_ends_at_the_accuracy(
    answers: tuple[BoolArray, FloatArray],
) -> None:
    correct, _ = answers
    curve = precision_recall_curve(*answers)
    assert curve.recall[-1] == float(correct.any())
    assert curve.precision[-1] == correct.mean()
    assert precision_at_full_recall(curve) >= correct.mean()


@given(best_matches(), st.sampled_from([0.25, 2.0, 1024.0]), st.integers(-8, 8))
def test_scaling_and_shifting_scores_changes_no_number(
    answers: tuple[BoolArray, FloatArray], scale: float, shift: int
) -> None:
    correct, score = answers
    curve = precision_recall_curve(correct, score)
    moved = precision_recall_curve(correct, score * scale + shift)
    np.testing.assert_array_equal(curve.recall, moved.recall)
    np.testing.assert_array_equal(curve.precision, moved.precision)
    np.testing.assert_array_equal(curve.threshold * scale + shift, moved.threshold)


@given(best_matches(), st.randoms(use_true_random=False))
def test_the_order_of_answers_does_not_matter(
    answers: tuple[BoolArray, FloatArray], random: object
) -> None:
    correct, score = answers
    order = np.arange(len(correct))
    random.shuffle(order)  # type: ignore[attr-defined]
    curve = precision_recall_curve(correct, score)
    shuffled = precision_recall_curve(correct[order], score[order])
    np.testing.assert_array_equal(curve.precision, shuffled.precision)


@given(best_matches(least=1))
def test_a_wrong_answer_below_all_others_raises_no_precision(
    answers: tuple[BoolArray, FloatArray],
) -> None:
    correct, score = answers
    before = precision_recall_curve(correct, score)
    after = precision_recall_curve(np.append(correct, False), np.append(score, score.min() - 1))
    np.testing.assert_array_equal(after.precision[:-1], before.precision)
    assert after.precision[-1] <= before.precision[-1]
    for number in NUMBERS:
        assert abs(number(after) - number(before)) < 1e-12


@given(best_matches(least=1))
def test_a_right_answer_above_all_others_lowers_no_number(
    answers: tuple[BoolArray, FloatArray],
) -> None:
    correct, score = answers
    n_positives = len(correct) + 1
    before = precision_recall_curve(correct, score, n_positives=n_positives)
    after = precision_recall_curve(
        np.append(correct, True), np.append(score, score.max() + 1), n_positives=n_positives
    )
    for number in NUMBERS:
        assert number(after) >= number(before) - 1e-12


@given(best_matches(least=1), st.integers(0, 9))
def test_single_is_thesis_with_recall_shrunk(
    answers: tuple[BoolArray, FloatArray], missed: int
) -> None:
    n_correct = int(answers[0].sum())
    thesis = precision_recall_curve(*answers)
    single = precision_recall_curve(*answers, n_positives=n_correct + missed)
    share = n_correct / max(1, n_correct + missed)
    np.testing.assert_allclose(single.recall, thesis.recall * share, atol=1e-15)
    assert area_under_curve(single) <= area_under_curve(thesis) + 1e-12


@given(matrices())
def test_recall_at_rises_with_n_to_all_that_can_be_found(
    matrix: tuple[FloatArray, BoolArray],
) -> None:
    similarity, truth = matrix
    n_references = similarity.shape[1]
    recall = recall_at(similarity, truth, n=range(1, n_references + 1))
    shares = list(recall.all_queries.values())
    assert shares == sorted(shares)
    assert shares[-1] == truth.any(axis=1).mean()
    best = similarity.argmax(axis=1)
    assert shares[0] == truth[np.arange(len(truth)), best].mean()


@given(matrices(), st.randoms(use_true_random=False))
def test_without_ties_the_order_of_references_does_not_matter(
    matrix: tuple[FloatArray, BoolArray], random: object
) -> None:
    similarity, truth = matrix
    distinct = similarity + np.linspace(0, 0.5, similarity.size).reshape(similarity.shape)
    order = np.arange(similarity.shape[1])
    random.shuffle(order)  # type: ignore[attr-defined]
    np.testing.assert_array_equal(
        true_match_rank(distinct, truth), true_match_rank(distinct[:, order], truth[:, order])
    )


@given(runs())
def test_evaluation_is_what_its_counts_say(run: tuple[Answers, GroundTruth]) -> None:
    answers, truth = run
    result = evaluate(answers, truth, n_resamples=20)
    right = 0
    for query, reference in zip(answers.query, answers.reference, strict=True):
        positives = truth.positives[query].tolist()
        right += reference in positives if reference >= 0 else not positives
    assert result.n_correct == right
    assert result.n_answered + result.n_unanswered == answers.n_queries
    assert result.accuracy_all_queries == right / answers.n_queries
    if result.n_answered:
        assert result.accuracy_all_queries <= result.accuracy
        assert 0 <= result.accuracy_interval.low <= result.accuracy_interval.high <= 1
    assert result.auc_single <= result.auc + 1e-12
    assert result.curve.n_positives == (result.correct & (answers.reference >= 0)).sum()


@given(runs(), st.randoms(use_true_random=False))
def test_permuting_the_map_changes_no_judgement(
    run: tuple[Answers, GroundTruth], random: object
) -> None:
    answers, truth = run
    order = np.arange(answers.n_references)
    random.shuffle(order)  # type: ignore[attr-defined]
    # Frame order[j] of the old map is frame j of the new one.
    new_number = np.append(np.argsort(order), -1)
    moved = Answers(**{**vars(answers), "reference": new_number[answers.reference]})
    before = evaluate(answers, truth, n_resamples=1)
    after = evaluate(moved, truth.select(None, order), n_resamples=1)
    np.testing.assert_array_equal(before.correct, after.correct)
    assert before.auc == after.auc


@given(runs(), st.randoms(use_true_random=False))
def test_selecting_frames_is_selecting_rows_and_columns(
    run: tuple[Answers, GroundTruth], random: object
) -> None:
    _, truth = run
    assert truth.n_references is not None
    queries, references = np.arange(truth.n_queries), np.arange(truth.n_references)
    random.shuffle(queries)  # type: ignore[attr-defined]
    random.shuffle(references)  # type: ignore[attr-defined]
    queries, references = queries[: len(queries) // 2 + 1], references[: len(references) // 2]
    selected = truth.select(queries, references)
    np.testing.assert_array_equal(selected.matrix(), truth.matrix()[np.ix_(queries, references)])


@given(runs())
def test_matrix_lists_and_judgement_agree(run: tuple[Answers, GroundTruth]) -> None:
    _, truth = run
    assert truth.n_references is not None
    query, reference = np.indices((truth.n_queries, truth.n_references))
    np.testing.assert_array_equal(truth.is_correct(query, reference), truth.matrix())
    np.testing.assert_array_equal(truth.has_match(), truth.matrix().any(axis=1))


@given(st.floats(0, 1), st.floats(1e-6, 1e3), st.floats(1e-6, 1e3), st.floats(1.01, 10))
def test_pcu_falls_with_encoding_time(p: float, t_e: float, t_e_max: float, slower: float) -> None:
    fast = performance_per_compute_unit(p, t_e=t_e, t_e_max=t_e_max)
    slow = performance_per_compute_unit(p, t_e=t_e * slower, t_e_max=t_e_max)
    assert 0 <= slow <= fast
