import importlib
import logging
import threading
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from retraverse import kernels
from retraverse.errors import ConfigError, InputError, MissingExtraError, ShapeError
from retraverse.kernels import numpy_regional, regional_scores

# The function of that name hides the module from an ordinary import.
backend = importlib.import_module("retraverse.kernels.backend")

Arrays = tuple[Any, Any, Any]

QUERY = np.array([[1, 0, 0, 0], [0, 0.5, 0.5, 0]], np.float32)
REFERENCES = np.array(
    [[[0, 1, 0, 0], [0.5, 0, 0, 0]], [[0, 0, 0, 1], [0, 0, 0, 1]], [[1, 1, 1, 1], [0, 0, 0, 0]]],
    np.float32,
)
WEIGHTS = np.array([[1, 0], [0, 1], [0.5, 0.5]], np.float32)
# Worked by hand: best matches of the two regions are (.5, .5), (0, 0) and (1, 1).
SCORES = np.array([[0.5, 0, 1], [0.5, 0, 1], [0.5, 0, 1]], np.float32)

BACKENDS = [pytest.param("auto", id="auto"), pytest.param("numpy", id="numpy")]


@pytest.fixture(params=BACKENDS)
def either_backend(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setenv("RETRAVERSE_KERNELS", request.param)
    return str(request.param)


@pytest.mark.usefixtures("either_backend")
class TestRegionalScores:
    def test_worked_example(self) -> None:
        np.testing.assert_array_equal(regional_scores(QUERY, REFERENCES, WEIGHTS), SCORES)

    def test_bytes_are_in_units_of_255(self) -> None:
        query = np.array([[255, 0], [0, 51]], np.uint8)
        references = np.array([[[255, 0], [0, 255]], [[51, 255], [0, 0]]], np.uint8)
        weights = np.eye(2, dtype=np.float32)
        expected = [[1, 0.2], [0.2, 0.2]]
        scores = regional_scores(query, references, weights)
        np.testing.assert_allclose(scores, expected, rtol=1e-6)

    def test_negative_products_win_over_nothing(self) -> None:
        query = np.array([[-1.0]], np.float32)
        references = np.array([[[3.0], [2.0], [4.0]]], np.float32)
        assert regional_scores(query, references, np.ones((1, 1), np.float32)) == -2

    def test_weights_may_be_negative(self) -> None:
        weights = np.array([[1, -1]], np.float32)
        assert (regional_scores(QUERY, REFERENCES, weights) == 0).all()

    @pytest.mark.parametrize("dtype", [np.float32, np.uint8])
    def test_no_weights_score_nothing(self, dtype: Any) -> None:
        query, references = np.ones((3, 5), dtype), np.ones((4, 2, 5), dtype)
        scores = regional_scores(query, references, np.zeros((2, 3), np.float32))
        np.testing.assert_array_equal(scores, np.zeros((2, 4)))

    def test_no_references_and_no_rows(self) -> None:
        assert regional_scores(QUERY, REFERENCES[:0], WEIGHTS).shape == (3, 0)
        assert regional_scores(QUERY, REFERENCES, WEIGHTS[:0]).shape == (0, 3)

    def test_memory_mapped_map(self, tmp_path: Path) -> None:
        np.save(tmp_path / "map.npy", REFERENCES)
        mapped = np.load(tmp_path / "map.npy", mmap_mode="r")
        np.testing.assert_array_equal(regional_scores(QUERY, mapped, WEIGHTS), SCORES)

    def test_reference_off_any_boundary(self) -> None:
        loose = np.frombuffer(b"x" + REFERENCES.tobytes(), np.uint8)[1:].view(np.float32)
        loose = loose.reshape(REFERENCES.shape)
        np.testing.assert_array_equal(regional_scores(QUERY, loose, WEIGHTS), SCORES)

    def test_query_and_weights_may_be_views(self) -> None:
        query, weights = np.repeat(QUERY, 2, axis=0)[::2], np.asfortranarray(WEIGHTS)
        np.testing.assert_array_equal(regional_scores(query, REFERENCES, weights), SCORES)

    def test_the_whole_range_of_bytes(self) -> None:
        query, references = np.full((1, 33), 255, np.uint8), np.full((1, 1, 33), 255, np.uint8)
        assert regional_scores(query, references, np.ones((1, 1), np.float32)) == 33


ONES = np.ones((2, 4), np.float32)
BAD_SHAPES = {
    "query of one axis": (QUERY[0], REFERENCES, WEIGHTS),
    "references of two axes": (QUERY, REFERENCES[0], WEIGHTS),
    "weights of one axis": (QUERY, REFERENCES, WEIGHTS[0]),
    "another length": (QUERY[:, :3], REFERENCES, WEIGHTS),
    "weights for other regions": (QUERY[:1], REFERENCES, WEIGHTS),
    "no query region": (QUERY[:0], REFERENCES, WEIGHTS[:, :0]),
    "no reference region": (QUERY, REFERENCES[:, :0], WEIGHTS),
    "no values": (QUERY[:, :0], REFERENCES[:, :, :0], WEIGHTS),
    "float64": (QUERY.astype(float), REFERENCES.astype(float), WEIGHTS),
    "mixed": (QUERY, REFERENCES.astype(np.uint8), WEIGHTS),
    "weights in float64": (QUERY, REFERENCES, WEIGHTS.astype(float)),
    "scattered references": (QUERY, REFERENCES[::2], WEIGHTS),
    "too long for integers": (
        np.zeros((1, 33_001), np.uint8),
        np.zeros((1, 1, 33_001), np.uint8),
        WEIGHTS[:, :1],
    ),
}


@pytest.mark.parametrize("arrays", BAD_SHAPES.values(), ids=BAD_SHAPES)
def test_bad_shapes_and_types(arrays: Arrays) -> None:
    with pytest.raises(ShapeError) as raised:
        regional_scores(*arrays)
    assert "\n" not in str(raised.value)


@pytest.mark.usefixtures("either_backend")
@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
class TestNotFinite:
    def test_query(self, value: float) -> None:
        query = QUERY.copy()
        query[1, 2] = value
        with pytest.raises(InputError, match="query holds"):
            regional_scores(query, REFERENCES, WEIGHTS)

    def test_weights(self, value: float) -> None:
        weights = WEIGHTS.copy()
        weights[0, 0] = value
        with pytest.raises(InputError, match="weights holds"):
            regional_scores(QUERY, REFERENCES, weights)

    @pytest.mark.parametrize("where", [0, 33, 63, 64, 127, 128])
    def test_first_bad_reference_is_named(self, value: float, where: int) -> None:
        references = np.zeros((9, 3, 43), np.float32)
        references[4].flat[where] = value
        references[7] = value
        with pytest.raises(InputError, match=r"references\[4\] holds"):
            regional_scores(np.ones((1, 43), np.float32), references, np.ones((1, 1), np.float32))


class TestHow:
    @pytest.mark.parametrize("threads", [0, -1])
    def test_no_threads(self, threads: int) -> None:
        with pytest.raises(ConfigError, match="threads"):
            regional_scores(QUERY, REFERENCES, WEIGHTS, threads=threads)

    def test_unknown_instruction_set_lists_those_there(self) -> None:
        with pytest.raises(ConfigError, match="sse9"):
            regional_scores(QUERY, REFERENCES, WEIGHTS, instruction_set="sse9")

    def test_instruction_sets_end_with_plain(self) -> None:
        if kernels.backend() == "numpy":
            assert kernels.instruction_sets() == ()
        else:
            assert kernels.instruction_sets()[-1] == "plain"

    def test_numpy_has_no_instruction_sets(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setenv("RETRAVERSE_KERNELS", "numpy")
        assert kernels.backend() == "numpy"
        assert kernels.instruction_sets() == ()
        with pytest.raises(ConfigError, match="NumPy twins"):
            regional_scores(QUERY, REFERENCES, WEIGHTS, instruction_set="plain")

    def test_twin_in_many_blocks(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setenv("RETRAVERSE_KERNELS", "numpy")
        monkeypatch.setattr(numpy_regional, "_BLOCK_VALUES", 3)
        np.testing.assert_array_equal(regional_scores(QUERY, REFERENCES, WEIGHTS), SCORES)


def missing() -> tuple[ModuleType | None, str]:
    return None, "no module of that name"


class TestBackend:
    @pytest.fixture(autouse=True)
    def clean(self, monkeypatch: pytest.MonkeyPatch) -> None:
        for name in ("RETRAVERSE_KERNELS", "RETRAVERSE_THREADS"):
            monkeypatch.delenv(name, raising=False)

    def test_unknown_choice(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setenv("RETRAVERSE_KERNELS", "fast")
        with pytest.raises(ConfigError, match="'fast', expected one of auto, native, numpy"):
            kernels.backend()

    def test_native_but_missing(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr(backend, "_compiled", missing)
        monkeypatch.setenv("RETRAVERSE_KERNELS", "native")
        with pytest.raises(MissingExtraError, match="C\\+\\+ compiler"):
            kernels.backend()

    def test_missing_is_said_once(
        self, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
    ) -> None:
        monkeypatch.setattr(backend, "_compiled", missing)
        backend._warn_once.cache_clear()
        with caplog.at_level(logging.WARNING, logger="retraverse"):
            assert [kernels.backend() for _ in range(3)] == ["numpy"] * 3
        assert [record.levelname for record in caplog.records] == ["WARNING"]
        np.testing.assert_array_equal(regional_scores(QUERY, REFERENCES, WEIGHTS), SCORES)

    def test_missing_is_said_once_by_many_threads(self, monkeypatch: pytest.MonkeyPatch) -> None:
        said: list[str] = []

        def slowly(text: str, *_: object) -> None:
            time.sleep(0.05)  # Every thread is inside before the first is through.
            said.append(text)

        monkeypatch.setattr(backend, "_compiled", missing)
        monkeypatch.setattr(backend._log, "warning", slowly)
        backend._warn_once.cache_clear()
        start = threading.Barrier(4)

        def ask(_: int) -> str:
            start.wait(timeout=30)
            return kernels.backend()

        with ThreadPoolExecutor(4) as threads:
            assert list(threads.map(ask, range(4))) == ["numpy"] * 4
        assert len(said) == 1

    def test_threads_from_the_environment(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setenv("RETRAVERSE_THREADS", "3")
        assert kernels.default_threads() == 3
        monkeypatch.delenv("RETRAVERSE_THREADS")
        assert kernels.default_threads() >= 1

    @pytest.mark.parametrize("value", ["0", "-2", "two", "1.5"])
    def test_bad_threads(self, monkeypatch: pytest.MonkeyPatch, value: str) -> None:
        monkeypatch.setenv("RETRAVERSE_THREADS", value)
        with pytest.raises(ConfigError, match="RETRAVERSE_THREADS"):
            kernels.default_threads()


class TestQuantise:
    def test_rounds_to_the_nearest(self) -> None:
        values = np.array([0, 1, 0.5 / 255 - 1e-6, 0.5 / 255 + 1e-6, 1 + 1e-7], np.float32)
        np.testing.assert_array_equal(kernels.quantise_regions(values), [0, 255, 0, 1, 255])

    def test_nothing_in_nothing_out(self) -> None:
        assert kernels.quantise_regions(np.empty((0, 32), np.float32)).shape == (0, 32)

    @pytest.mark.parametrize("value", [-0.01, 1.01, np.nan])
    def test_values_that_are_no_such_descriptors(self, value: float) -> None:
        with pytest.raises(InputError, match="expected values in"):
            kernels.quantise_regions(np.array([0.5, value], np.float32))
