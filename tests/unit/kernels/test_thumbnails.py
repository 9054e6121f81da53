"""Thumbnail differences: exact sums on every instruction set and in NumPy, wrong input."""

from typing import Any

import numpy as np
import pytest

from retraverse.errors import ConfigError, ShapeError
from retraverse.kernels import instruction_sets, thumbnail_differences, thumbnails

Difference = thumbnails.Difference
SETS = [*instruction_sets(), "numpy"]


def on(name: str, monkeypatch: pytest.MonkeyPatch) -> str | None:
    """Return the instruction set to ask for; None where the NumPy twin was put in place."""
    if name != "numpy":
        return name
    monkeypatch.setattr(thumbnails, "native", lambda: None)
    return None


def pictures(seed: int, n_frames: int, n_pixels: int) -> Any:
    print("seed", seed)
    random = np.random.default_rng(seed)
    return random.integers(0, 256, (n_frames, n_pixels)).astype(np.uint8)


def expected(queries: Any, references: Any, difference: str) -> list[list[int]]:
    """Return the sums pixel by pixel, in Python's own numbers."""

    def apart(q: int, r: int) -> int:
        return max(q - r, 0) if difference == "saturating" else abs(q - r)

    return [
        [sum(map(apart, query, reference)) for reference in references.tolist()]
        for query in queries.tolist()
    ]


@pytest.mark.parametrize("difference", ["absolute", "saturating"])
@pytest.mark.parametrize("instruction_set", SETS)
@pytest.mark.parametrize("n_pixels", [1, 31, 64, 100, 2048])
def test_sums_are_exact(
    n_pixels: int, instruction_set: str, difference: Difference, monkeypatch: pytest.MonkeyPatch
) -> None:
    queries, references = pictures(n_pixels, 3, n_pixels), pictures(n_pixels + 1, 7, n_pixels)
    newest = on(instruction_set, monkeypatch)
    sums = thumbnail_differences(queries, references, difference=difference, instruction_set=newest)
    assert sums.dtype == np.uint32
    assert sums.tolist() == expected(queries, references, difference)


@pytest.mark.parametrize("instruction_set", SETS)
def test_the_largest_sum_fits(instruction_set: str, monkeypatch: pytest.MonkeyPatch) -> None:
    n_pixels = 1024 * 1024
    white, black = np.full((1, n_pixels), 255, np.uint8), np.zeros((1, n_pixels), np.uint8)
    newest = on(instruction_set, monkeypatch)
    for difference, back in (("absolute", 255 * n_pixels), ("saturating", 0)):
        ask: Any = {"difference": difference, "instruction_set": newest}
        assert thumbnail_differences(white, black, **ask).item() == 255 * n_pixels
        assert thumbnail_differences(black, white, **ask).item() == back


@pytest.mark.parametrize("threads", [1, 2, 5])
def test_any_number_of_threads_and_tiles(threads: int) -> None:
    queries, references = pictures(1, 9, 4096), pictures(2, 300, 4096)
    sums = thumbnail_differences(queries, references, threads=threads)
    wide = references.astype(np.int64)
    for row, query in enumerate(queries.astype(np.int64)):
        np.testing.assert_array_equal(sums[row], np.abs(wide - query).sum(axis=1))


def test_rows_need_not_lie_together() -> None:
    wide = pictures(3, 8, 80)
    apart, together = wide[::2, 3:67], wide[::2, 3:67].copy()
    np.testing.assert_array_equal(
        thumbnail_differences(apart, apart), thumbnail_differences(together, together)
    )


def test_nobody_has_no_differences() -> None:
    some = pictures(4, 3, 16)
    assert thumbnail_differences(some[:0], some).shape == (0, 3)
    assert thumbnail_differences(some, some[:0]).shape == (3, 0)
    assert thumbnail_differences(some[:, :0], some[:, :0]).tolist() == [[0] * 3] * 3


@pytest.mark.parametrize(
    ("queries", "references", "arguments", "error", "said"),
    [
        (np.zeros((2, 4)), np.zeros((2, 4), np.uint8), {}, ShapeError, "queries are float64"),
        (np.zeros((2, 4), np.uint8), np.zeros(4, np.uint8), {}, ShapeError, r"shape \(4,\)"),
        (np.zeros((2, 4), np.uint8), np.zeros((2, 5), np.uint8), {}, ShapeError, "resolution"),
        (np.zeros((2, 4), np.uint8), np.zeros((2, 4), np.uint8), {"threads": 0}, ConfigError,
         "at least 1"),
        (np.zeros((2, 4), np.uint8), np.zeros((2, 4), np.uint8), {"difference": "squared"},
         ConfigError, "'saturating'"),
        (np.zeros((2, 4), np.uint8), np.zeros((2, 4), np.uint8), {"instruction_set": "mmx"},
         ConfigError, "'mmx' is not here"),
    ],
)  # fmt: skip
def test_wrong_input(
    queries: Any, references: Any, arguments: Any, error: type[Exception], said: str
) -> None:
    with pytest.raises(error, match=said):
        thumbnail_differences(queries, references, **arguments)
