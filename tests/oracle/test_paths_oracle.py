"""Path matchers against their definitions, written out as loops over cells, paths and states."""

import itertools
import math
from typing import Any

import numpy as np
import pytest

import retraverse as rt
from retraverse import kernels
from retraverse.kernels import Motion, paths
from retraverse.kernels.backend import native
from retraverse.matching.matchers.evidence import drive_evidence, running_evidence
from retraverse.matching.matchers.hmm import Hmm, HmmParameters, ViterbiSearch
from retraverse.matching.matchers.trails import GraphTrail, lagged, whole


@pytest.fixture(params=["native", "numpy"], autouse=True)
def kernels_in_use(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if request.param == "numpy":
        monkeypatch.setattr(paths, "native", lambda: None)
    elif native() is None:
        pytest.skip("no compiled kernels here")


def normal(seed: int, n_queries: int, n_references: int) -> Any:
    print("seed", seed)
    return np.random.default_rng(seed).normal(size=(n_queries, n_references)).astype(np.float32)


# --- warping -------------------------------------------------------------------------------


def slow_dtw(cost: Any, is_open: bool) -> float:
    """Cost of the cheapest path, from the recurrence of Sakoe and Chiba."""
    n_queries, n = cost.shape
    total = [[math.inf] * n for _ in range(n_queries)]
    for i in range(n_queries):
        for j in range(n):
            before = [0.0] if i == 0 and (is_open or j == 0) else []
            if i:
                before.append(total[i - 1][j])
            if j:
                before.append(total[i][j - 1])
            if i and j:
                before.append(total[i - 1][j - 1])
            total[i][j] = min(before) + float(cost[i, j])
    return min(total[-1]) if is_open else total[-1][-1]


def walk(cost: Any, steps: Any, end: int) -> tuple[float, tuple[int, int]]:
    """Follow the steps back; return what the path costs and where it begins."""
    i, j, total = len(cost) - 1, end, 0.0
    while True:
        total += float(cost[i, j])
        step = steps[i, j]
        if step == 3:
            return total, (i, j)
        i -= step in (0, 1)
        j -= step in (0, 2)
        assert i >= 0
        assert j >= 0


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("is_open", [True, False])
def test_the_warping_path_is_the_cheapest(seed: int, is_open: bool) -> None:
    random = np.random.default_rng(seed)
    shape = random.integers(1, 15, 2)
    cost = random.exponential(size=shape).astype(np.float32)
    if seed % 2:
        cost = np.round(cost, 1)
    steps, end = kernels.dtw_steps(cost, open=is_open)
    total, start = walk(cost, steps, end)
    assert total == pytest.approx(slow_dtw(cost, is_open), rel=1e-6)
    assert start[0] == 0
    if not is_open:
        assert (start[1], end) == (0, shape[1] - 1)


# --- hidden Markov model ----------------------------------------------------------------------

SMALL = Motion(
    moves=np.array([1, 0, 2, -1]),
    weights=np.array([0.4, 0.2, 0.25, 0.05], np.float32),
    jump=0.04,
    leave=0.06,
    enter=0.3,
)


def transitions(motion: Motion, n: int) -> Any:
    """Return (n + 1, n + 1): probability from each state to each, the last being outside."""
    table = np.zeros((n + 1, n + 1))
    for r in range(n):
        table[r, :n] += motion.jump / n
        for move, weight in zip(motion.moves.tolist(), motion.weights.tolist(), strict=True):
            if 0 <= r + move < n:
                table[r, r + move] += weight
        table[r, n] = motion.leave
    table[n, :n] = motion.enter / n
    table[n, n] = 1 - motion.enter
    return table


@pytest.mark.parametrize("seed", range(5))
def test_forward_and_backward_by_summing_over_all_paths(seed: int) -> None:
    n, n_rows = 4, 5
    likelihood = np.exp(normal(seed, n_rows, n))
    prior = np.random.default_rng(seed).dirichlet(np.ones(n + 1)).astype(np.float32)
    table, weights = transitions(SMALL, n), np.column_stack([likelihood, np.ones(n_rows)])
    joint = np.zeros((n_rows, n + 1))
    filtered = np.zeros((n_rows, n + 1))
    for path in itertools.product(range(n + 1), repeat=n_rows + 1):
        probability = float(prior[path[0]])
        for i in range(n_rows):
            probability *= table[path[i], path[i + 1]] * weights[i, path[i + 1]]
            if all(later == 0 for later in path[i + 2 :]):
                filtered[i, path[i + 1]] += probability  # each beginning once
        for i in range(n_rows):
            joint[i, path[i + 1]] += probability
    beliefs = kernels.forward(likelihood, SMALL, prior.copy())
    last = np.full(n + 1, 1 / (n + 1), np.float32)
    messages = kernels.backward(likelihood, SMALL, last)
    filtered /= filtered.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(beliefs, filtered, rtol=1e-4)
    both = beliefs * messages
    both /= both.sum(axis=1, keepdims=True)
    joint /= joint.sum(axis=1, keepdims=True)
    np.testing.assert_allclose(both, joint, rtol=1e-4)


def log_probability(path: list[int], evidence: Any, table: Any, prior: Any) -> float:
    """Log probability of a path of states, -1 = outside; ways that differ count apart."""
    n = evidence.shape[1]
    total = math.log(prior[path[0]])
    for i, state in enumerate(path):
        total += float(evidence[i, state]) if state >= 0 else 0.0
        if i:
            total += math.log(table[path[i - 1] if path[i - 1] >= 0 else n][state])
    return total


def best_ways(motion: Motion, n: int) -> list[list[float]]:
    """Probability of the likeliest single way between two states (a move or a jump, not both)."""
    table = np.zeros((n + 1, n + 1))
    for r in range(n):
        table[r, :n] = motion.jump / n
        for move, weight in zip(motion.moves.tolist(), motion.weights.tolist(), strict=True):
            if 0 <= r + move < n:
                table[r, r + move] = max(table[r, r + move], weight)
        table[r, n] = motion.leave
    table[n, :n], table[n, n] = motion.enter / n, 1 - motion.enter
    return [list(row) for row in table]


@pytest.mark.parametrize("seed", range(10))
def test_the_viterbi_path_is_the_likeliest_of_all(seed: int) -> None:
    n, n_rows = 4, 6
    hmm = Hmm(HmmParameters(jump=0.05, leave=0.1, enter=0.2, back=1, forward=2))
    z = 1.5 * normal(seed, n_rows, n)
    trail = ViterbiSearch(hmm).advance(z)
    evidence = hmm.log_likelihood(z)
    table, prior = best_ways(hmm.motion, n), hmm.prior(n).tolist()
    paths_ = itertools.product(range(-1, n), repeat=n_rows)
    best = max(log_probability(list(path), evidence, table, prior) for path in paths_)
    found, _ = whole(trail, z, 1)
    assert log_probability(found.tolist(), evidence, table, prior) == pytest.approx(best, abs=1e-4)


# --- graph ---------------------------------------------------------------------------------

COSTS = {"hidden": 0.5, "surface": 1.0, "jump": 2.5}
MOVES = np.array([1, 0, 2, -1])


def slow_graph(evidence: Any) -> float:
    """Return the worth of the best path, by relaxing every edge of the graph."""
    n_queries, n = evidence.shape
    worth = {(r, h): (COSTS["hidden"] if h else float(evidence[0, r]))
             for r in range(n) for h in (False, True)}  # fmt: skip
    # nodes before the first row are all alike: coming out of hiding there costs nothing
    for i in range(1, n_queries):
        after = {}
        for r in range(n):
            reached = [s for s in range(n) if r - s in MOVES]
            ways = [worth[s, False] for s in reached]
            ways += [worth[s, True] - COSTS["surface"] for s in reached]
            after[r, False] = max(ways, default=-math.inf) + float(evidence[i, r])
            ways = [worth[s, h] for s in reached for h in (False, True)]
            ways += [worth[s, h] - COSTS["jump"] for s in range(n) for h in (False, True)]
            after[r, True] = max(ways) + COSTS["hidden"]
        worth = after
    return max(worth.values())


def worth_of(path: list[tuple[int, bool]], evidence: Any) -> float:
    total = 0.0
    for i, (r, hidden) in enumerate(path):
        total += COSTS["hidden"] if hidden else float(evidence[i, r])
        if i:
            s, was_hidden = path[i - 1]
            total -= COSTS["surface"] * (was_hidden and not hidden)
            if r - s not in MOVES:
                assert hidden, "a path may jump in hiding only"
                total -= COSTS["jump"]
    return total


@pytest.mark.parametrize("seed", range(10))
def test_the_graph_path_is_the_best(seed: int) -> None:
    n = 9
    evidence = normal(seed, 14, n)
    rows = kernels.graph(evidence, MOVES, np.zeros((2, n), np.float32), **COSTS)
    trail = GraphTrail(rows, MOVES)
    state = [int(trail.best[-1])]
    for i in range(len(evidence) - 1, 0, -1):
        state.insert(0, int(trail.before(np.array([i]), np.array([state[0]]))[0]))
    path = [(s % n, s >= n) for s in state]
    assert worth_of(path, evidence) == pytest.approx(slow_graph(evidence), abs=1e-4)


# --- following paths -------------------------------------------------------------------------


@pytest.mark.parametrize("K", [1, 2, 5, 14, 40])
@pytest.mark.parametrize("kind", ["viterbi", "graph"])
def test_lagged_answers_one_by_one(K: int, kind: str) -> None:
    z = normal(3, 14, 9)
    if kind == "viterbi":
        trail: Any = ViterbiSearch(Hmm(HmmParameters(leave=0.2, enter=0.2))).advance(z)
    else:
        rows = kernels.graph(z, MOVES, np.zeros((2, 9), np.float32), **COSTS)
        trail = GraphTrail(rows, MOVES)
    reference, score = lagged(trail, z, K)
    for frame in range(14):
        at = min(frame + K - 1, 13)
        state, seen = trail.best[at : at + 1], []
        while True:
            place = int(trail.places(state)[0])
            seen += [float(z[at, place])] if place >= 0 else []
            if at == frame:
                break
            state = trail.before(np.array([at]), state)
            at -= 1
        assert reference[frame] == place
        assert score[frame] == pytest.approx(sum(seen) / max(len(seen), 1), abs=1e-5)


def standard(values: Any, axis: int) -> Any:
    return (values - values.mean(axis, keepdims=True)) / values.std(axis, keepdims=True)


def test_evidence_by_its_definition() -> None:
    scores = normal(1, 6, 30) * 3 + 7
    expected = np.clip(standard(scores.astype(float), 1), -5, 5)
    np.testing.assert_allclose(drive_evidence(scores, "row"), expected, atol=1e-4)
    np.testing.assert_allclose(running_evidence(scores, "row"), expected, atol=1e-4)


def test_balanced_evidence_by_its_definition() -> None:
    # The prior is ten frames more of which five say +1 and five -1: mean 0 and deviation 1.
    scores = normal(2, 40, 30) + np.linspace(0, 4, 30, dtype=np.float32)
    prior = np.repeat([[1.0], [-1.0]], 5, axis=0) * np.ones(30)
    rows = standard(scores.astype(float), 1)
    seen = standard(np.concatenate([rows, prior]), 0)[: len(rows)]
    expected = np.clip(standard(seen, 1), -5, 5)
    np.testing.assert_allclose(drive_evidence(scores, "balanced"), expected, atol=1e-4)
    for last in (1, 2, 17, 40):
        so_far = drive_evidence(scores[:last], "balanced")[-1]
        running = running_evidence(scores, "balanced")[last - 1]
        np.testing.assert_allclose(running, so_far, atol=1e-4)


def test_a_row_that_says_nothing_has_no_evidence() -> None:
    scores = normal(4, 20, 30) + np.linspace(0, 4, 30, dtype=np.float32)
    scores[7] = 3.0
    for evidence in (drive_evidence(scores, "balanced"), running_evidence(scores, "balanced")):
        assert not evidence[7].any()
        assert evidence[8].any()


def test_a_reference_that_looks_like_everything_loses_its_hold() -> None:
    scores = normal(5, 60, 40)
    scores[np.arange(40), np.arange(40)] += 2
    scores[:, 11] += 4
    told = drive_evidence(scores, "row").argmax(axis=1)
    balanced = drive_evidence(scores, "balanced").argmax(axis=1)
    assert (told == 11).mean() > 0.8
    assert (balanced == 11).mean() < 0.1


@pytest.mark.parametrize("decode", ["filter", "smooth", "viterbi", "lag"])
def test_blocks_of_rows_change_nothing(decode: str, monkeypatch: pytest.MonkeyPatch) -> None:
    scores, chosen = normal(2, 50, 12), rt.matcher("hmm", decode=decode)
    once = rt.match_similarity(scores, matcher=chosen)
    for block in (1, 7, 49, 50):
        monkeypatch.setattr("retraverse.matching.matchers.hmm.BLOCK_ROWS", block)
        again = rt.match_similarity(scores, matcher=chosen)
        np.testing.assert_array_equal(again.reference, once.reference)
        np.testing.assert_allclose(again.score, once.score, atol=1e-5)
