"""Growth of windows: worked examples of the rule, and a transcription of the authors' loop."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from retraverse.matching import GrowthRule, dynamic_windows

RULE = GrowthRule()


def by_distance(similarities: list[float]) -> object:
    """Return an overlap that depends on how far the later frame is from the first."""
    return lambda first, later: similarities[min(later - first, len(similarities)) - 1]


def test_window_grows_while_frames_look_alike() -> None:
    entropy = np.full(30, 0.7)
    windows = dynamic_windows(entropy, by_distance([0.97, 0.95, 0.92, 0.88]), RULE)  # type: ignore[arg-type]
    assert windows[0].length == 5
    assert windows[0].sequential_entropy == pytest.approx(0.7)


def test_dark_traverse_grows_to_the_largest_length() -> None:
    windows = dynamic_windows(np.full(60, 0.3), lambda first, later: 0.95, RULE)
    assert windows[0].length == 25


def test_overlap_alone_stops_at_its_own_limit() -> None:
    windows = dynamic_windows(np.full(60, 0.7), lambda first, later: 0.95, RULE)
    assert windows[0].length == 15


def test_nothing_alike_still_takes_two_frames() -> None:
    windows = dynamic_windows(np.full(10, 0.7), lambda first, later: 0.1, RULE)
    assert [window.length for window in windows] == [2] * 9


def test_tail_gets_no_window() -> None:
    windows = dynamic_windows(np.full(40, 0.7), lambda first, later: 0.95, RULE)
    assert [window.start for window in windows] == list(range(26))
    assert {window.length for window in windows} == {15}


@pytest.mark.parametrize("n_frames", [0, 1, 2])
def test_short_traverses(n_frames: int) -> None:
    windows = dynamic_windows(np.full(n_frames, 0.7), lambda first, later: 0.95, RULE)
    assert [window.length for window in windows] == [n_frames][: min(n_frames, 1)]


def authors_loop(
    entropy: list[float], score: dict[tuple[int, int], float], rule: GrowthRule
) -> list[tuple[int, int]]:
    """Follow the published rule line by line, with its set of frames seen and both counters."""
    answers, seen, N = [], set[int](), len(entropy)
    for i in range(N):
        k, n, c, H, mean, done = rule.min_length + 1, 0, 0, 0.0, 0.0, False
        while (
            len(seen) < N
            and ((mean <= rule.sequence_entropy or c < rule.min_length) or not done)
            and n < rule.max_length
        ):
            j = i + c
            n += 1
            seen.add(j)
            H += entropy[j]
            if n > 1:
                if score[i, j] >= rule.information_threshold and k < rule.max_overlap_length:
                    k += 1
                else:
                    done = True
            if c < rule.max_length:
                c += 1
                mean = H / c
                if (
                    mean <= rule.sequence_entropy
                    and k < rule.max_length
                    and c >= rule.min_length
                    and done
                ):
                    k += 1
        k = min(k, n)
        if k == 0:
            break
        answers.append((i, k))
    return answers


@given(
    seed=st.integers(0, 2**32 - 1),
    n_frames=st.integers(1, 40),
    level=st.floats(0.2, 0.8),
    alike=st.floats(0.5, 1),
    lengths=st.tuples(st.integers(1, 4), st.integers(4, 12), st.integers(12, 25)),
)
def test_same_windows_as_the_authors_loop(
    seed: int, n_frames: int, level: float, alike: float, lengths: tuple[int, int, int]
) -> None:
    random = np.random.default_rng(seed)
    entropy = np.clip(level + random.normal(0, 0.1, n_frames), 0, 1)
    scores = {
        (i, j): float(np.clip(alike + random.normal(0, 0.08), 0, 1))
        for i in range(n_frames)
        for j in range(i, n_frames)
    }
    rule = GrowthRule(min_length=lengths[0], max_overlap_length=lengths[1], max_length=lengths[2])
    windows = dynamic_windows(entropy, lambda first, later: scores[first, later], rule)
    expected = authors_loop(entropy.tolist(), scores, rule)
    assert [(window.start, window.length) for window in windows] == expected
