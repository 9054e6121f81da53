import sys
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tests.unit.techniques.tiny_network import TinyTechnique, pictures, write_tiny_weights

from retraverse.errors import ConfigError, DataMissingError, InputError
from retraverse.images import Frame
from retraverse.techniques import Descriptions
from retraverse.techniques.running import onnx_runtime
from retraverse.techniques.running.onnx_runtime import OnnxRunner, export_onnx, graph_path
from retraverse.techniques.running.quantise import QuantisedGraph, quantise


def tiny(weights: Path, **parameters: Any) -> TinyTechnique:
    return TinyTechnique(replace(TinyTechnique().parameters, weights=str(weights), **parameters))


@pytest.fixture(scope="module")
def weights(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return write_tiny_weights(tmp_path_factory.mktemp("weights") / "tiny.safetensors")


@pytest.fixture(scope="module", autouse=True)
def store(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """One weights folder for all tests: an export takes seconds, and is kept there."""
    folder = tmp_path_factory.mktemp("store")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("RETRAVERSE_WEIGHTS", str(folder))
        yield folder


@pytest.fixture(scope="module")
def graph(weights: Path, store: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export_onnx(tiny(weights), tmp_path_factory.mktemp("graph") / "tiny.onnx")


def described(technique: TinyTechnique) -> Any:
    return Descriptions.stack(technique.describe_batch(pictures(5)), technique.layout).descriptor


def test_a_graph_is_run_as_weights(weights: Path, graph: Path) -> None:
    np.testing.assert_allclose(described(tiny(graph)), described(tiny(weights)), atol=1e-6)
    with pytest.raises(ConfigError, match=r"a graph for ONNX Runtime, expected weights"):
        tiny(graph).network()


def test_a_graph_takes_any_number_of_pictures(graph: Path) -> None:
    run = OnnxRunner(graph, threads=1)
    noise = np.random.default_rng(0).standard_normal((7, 3, 24, 24), dtype=np.float32)
    one_by_one = np.concatenate([run(noise[row : row + 1]) for row in range(7)])
    np.testing.assert_allclose(run(noise), one_by_one, atol=1e-6)


def test_the_runtime_exports_once_and_then_needs_no_torch(
    weights: Path, graph: Path, store: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    expected = described(tiny(weights))
    assert list((store / "onnx").iterdir()) == [graph_path(tiny(weights))]
    monkeypatch.setitem(sys.modules, "torch", None)
    np.testing.assert_allclose(described(tiny(weights, runtime="onnx")), expected, atol=1e-6)


def test_a_damaged_kept_graph_is_made_again(
    weights: Path, graph: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kept = graph_path(tiny(weights))
    whole = kept.read_bytes()
    kept.write_bytes(whole[:500])
    monkeypatch.setattr(onnx_runtime, "_exported", lambda _technique: whole)
    described(tiny(weights, runtime="onnx"))
    assert kept.read_bytes() == whole


def test_kept_graphs_are_told_apart(weights: Path, tmp_path: Path) -> None:
    other = write_tiny_weights(tmp_path / "other.safetensors", seed=9)
    paths = {
        graph_path(tiny(weights)),
        graph_path(tiny(weights, scale=3.0)),
        graph_path(tiny(other)),
        graph_path(tiny(weights, runtime="onnx", threads=3)),
    }
    assert len(paths) == 3


def test_a_graph_of_another_shape_is_refused(graph: Path) -> None:
    with pytest.raises(InputError, match=r"tiny\.onnx: got pictures of shape \(1, 3, 9, 9\)"):
        OnnxRunner(graph, threads=1)(np.zeros((1, 3, 9, 9), np.float32))


@pytest.mark.parametrize("content", [b"", b"not a graph", b"\x08\x07" * 50])
def test_what_is_no_graph_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "x.onnx"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"x\.onnx: ONNX Runtime refuses it"):
        tiny(path).describe(pictures(1)[0])


def test_where_a_graph_cannot_be_written(weights: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"ends with \.onnx"):
        export_onnx(tiny(weights), tmp_path / "graph.pb")
    with pytest.raises(DataMissingError, match="does not exist"):
        export_onnx(tiny(weights), tmp_path / "no" / "graph.onnx")


@pytest.fixture(scope="module")
def frames() -> list[Frame]:
    return [Frame.from_array(one, name=str(row)) for row, one in enumerate(pictures(30))]


@pytest.mark.parametrize(("method", "least"), [("static", 0.97), ("dynamic", 0.9)])
def test_int8_says_what_it_loses(
    weights: Path, frames: list[Frame], tmp_path: Path, method: Any, least: float
) -> None:
    path = tmp_path / "int8.onnx"
    report = quantise(tiny(weights), frames, path, method=method)
    assert isinstance(report, QuantisedGraph)
    assert report.path == path
    assert report.n_bytes == path.stat().st_size
    cosines = np.einsum("ij,ij->i", described(tiny(weights)), described(tiny(path)))
    assert cosines.min() > least
    assert cosines.max() < 1 - 1e-7, "int8 cannot be exact: was the float graph written?"
    assert least < report.least_cosine <= report.mean_cosine <= 1
    assert 0.5 < report.same_neighbour <= 1
    assert tiny(path).fingerprint() != tiny(weights).fingerprint()


def test_int8_wants_pictures_and_a_place(
    weights: Path, frames: list[Frame], tmp_path: Path
) -> None:
    with pytest.raises(InputError, match="got 1 pictures, expected at least 2"):
        quantise(tiny(weights), frames[:1], tmp_path / "a.onnx")
    with pytest.raises(InputError, match=r"ends with \.onnx"):
        quantise(tiny(weights), frames, tmp_path / "a.int8")
    assert not list(tmp_path.iterdir())
