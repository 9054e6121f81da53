import sys
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from safetensors.numpy import load_file, save_file
from skimage import data
from tests.unit.techniques.tiny_network import (
    TinyNetwork,
    TinyTechnique,
    pictures,
    write_tiny_weights,
)

import retraverse as rt
from retraverse.errors import ConfigError, DataMissingError, MapError, MissingExtraError
from retraverse.images import Frame, decode_bgr, encode_jpeg
from retraverse.maps import TechniqueRecord
from retraverse.techniques import BatchTechnique, FingerprintedTechnique, registry
from retraverse.techniques.running.file_digest import file_digest
from retraverse.techniques.running.torch_runtime import torch_threads
from retraverse.types import ImageArray
from retraverse.weights.store import CLEAN_WEIGHTS


@pytest.fixture
def tiny(tmp_path: Path) -> TinyTechnique:
    return with_weights(write_tiny_weights(tmp_path / "a.safetensors"))


def with_weights(path: Path, **parameters: Any) -> TinyTechnique:
    return TinyTechnique(replace(TinyTechnique().parameters, weights=str(path), **parameters))


def frames(count: int) -> list[Frame]:
    return [
        Frame.from_array(picture, name=f"{row}.png", index=row)
        for row, picture in enumerate(pictures(count))
    ]


@pytest.fixture
def listed() -> Iterator[None]:
    """Let the registry know the tiny technique, as maps on disk ask it."""
    registry.register(type(TinyTechnique().parameters))(TinyTechnique)
    yield
    del registry._registry._entries["tiny"]


def test_a_description_is_the_networks_output_as_a_unit_vector(tiny: TinyTechnique) -> None:
    picture = pictures(1)[0]
    network = TinyNetwork().eval()
    network.load_state_dict(tiny.network().state_dict())
    with torch.no_grad():
        plain = network(torch.from_numpy(tiny.prepare(picture))[None]).numpy().ravel()
    described = tiny.describe(picture)["descriptor"]
    assert described.dtype == np.float32
    np.testing.assert_allclose(described, plain / np.linalg.norm(plain), atol=1e-6)


@pytest.mark.parametrize("batch", [0, 1, 3, 16])
def test_batches_are_as_one_by_one(tiny: TinyTechnique, batch: int) -> None:
    flat = np.full((20, 30, 3), 90, np.uint8)
    images = [*pictures(6), flat, *pictures(1)]
    batched = with_weights(Path(tiny.parameters.weights), batch=batch)
    for image, together in zip(images, batched.describe_batch(images), strict=True):
        np.testing.assert_allclose(
            together["descriptor"], tiny.describe(image)["descriptor"], atol=1e-6
        )
    assert batched.describe_batch([]) == []


def test_pictures_of_one_colour_have_no_descriptor(tiny: TinyTechnique) -> None:
    assert not tiny.describe(np.full((9, 9, 3), (1, 2, 3), np.uint8))["descriptor"].any()
    almost = np.full((9, 9, 3), (1, 2, 3), np.uint8)
    almost[8, 8, 2] += 1
    assert tiny.describe(almost)["descriptor"].any()


def test_it_is_what_maps_take_for_batched_and_fingerprinted(tiny: TinyTechnique) -> None:
    assert isinstance(tiny, BatchTechnique)
    assert isinstance(tiny, FingerprintedTechnique)
    assert not isinstance(rt.technique("hog"), BatchTechnique | FingerprintedTechnique)


def test_threads_at_once_load_one_network(tiny: TinyTechnique) -> None:
    with ThreadPoolExecutor(4) as pool:
        networks = list(pool.map(lambda _: tiny.network(), range(8)))
    assert all(network is networks[0] for network in networks)
    assert not networks[0].training
    assert not any(weight.requires_grad for weight in networks[0].parameters())


def test_without_torch_the_extra_is_named(
    tiny: TinyTechnique, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "torch", None)
    with pytest.raises(MissingExtraError, match=r"torch .* pip install 'retraverse\[learned\]'"):
        tiny.describe(pictures(1)[0])


def test_without_onnxruntime_the_extra_is_named(
    tiny: TinyTechnique, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "onnxruntime", None)
    onnx = with_weights(Path(tiny.parameters.weights), runtime="onnx")
    with pytest.raises(MissingExtraError, match=r"onnxruntime .*retraverse\[learned\]"):
        onnx.describe(pictures(1)[0])


def test_missing_weights_say_so_at_the_first_description(tmp_path: Path) -> None:
    nowhere = with_weights(tmp_path / "gone.safetensors")
    assert nowhere.layout.dimension == 384
    for ask in (nowhere.fingerprint, lambda: nowhere.describe(pictures(1)[0])):
        with pytest.raises(DataMissingError, match=r"gone\.safetensors.*no such file"):
            ask()


def test_other_runtimes_threads_and_places_are_the_same_map(
    tiny: TinyTechnique, tmp_path: Path
) -> None:
    moved = write_tiny_weights(tmp_path / "moved.safetensors")
    other = with_weights(moved, runtime="onnx", threads=2, batch=4)
    record = TechniqueRecord.of(tiny)
    assert record.fingerprint == tiny.fingerprint()
    assert TechniqueRecord.of(other).parameters["runtime"] == "onnx"
    record.require(other, "the map")


def test_other_weights_of_the_same_name_are_another_map(
    tiny: TinyTechnique, tmp_path: Path
) -> None:
    record = TechniqueRecord.of(tiny)
    again = write_tiny_weights(tmp_path / "a.safetensors", seed=1)
    with pytest.raises(MapError, match=r"weights of SHA-256 .* use those weights, or build"):
        record.require(with_weights(again), "the map")
    with pytest.raises(MapError, match=r"scale=1\.0.* you asked for .*scale=2\.0"):
        record.require(with_weights(tmp_path / "a.safetensors", scale=2.0), "the map")


def test_a_map_opens_without_its_weights_but_describes_nothing(
    tiny: TinyTechnique, tmp_path: Path, listed: None
) -> None:
    rt.build_map(frames(5), tiny, path=tmp_path / "map")
    weights = Path(tiny.parameters.weights)
    with_them = rt.load_map(tmp_path / "map")
    weights.rename(tmp_path / "away")
    loaded = rt.load_map(tmp_path / "map")
    assert loaded.provenance.technique.fingerprint == tiny.fingerprint()
    np.testing.assert_array_equal(
        loaded.descriptions().descriptor, with_them.descriptions().descriptor
    )
    with pytest.raises(DataMissingError, match="no such file"):
        loaded.technique.describe(pictures(1)[0])
    write_tiny_weights(weights, seed=5)
    with pytest.raises(MapError, match="use those weights"):
        rt.load_map(tmp_path / "map")


def test_maps_of_batches_are_as_of_single_frames(tiny: TinyTechnique) -> None:
    weights = Path(tiny.parameters.weights)
    one_by_one, batched = (
        rt.build_map(frames(37), with_weights(weights, batch=batch)).descriptions().descriptor
        for batch in (1, 5)
    )
    np.testing.assert_allclose(batched, one_by_one, atol=1e-6)


def test_torch_gets_its_threads_back() -> None:
    before = torch.get_num_threads()
    with torch_threads(before + 1):
        with torch_threads(before + 2):
            assert torch.get_num_threads() == before + 2
        assert torch.get_num_threads() == before + 1
    assert torch.get_num_threads() == before


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"threads": 0}, "threads: got 0, expected 1 to 256"),
        ({"batch": -1}, "batch: got -1, expected 0 to 256"),
        ({"runtime": "caffe"}, "expected one of 'torch', 'onnx'"),
        ({"weights": 3}, "expected text"),
        ({"weights": "a\nb"}, "expected printable text"),
    ],
)
def test_parameters_out_of_range(wrong: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        rt.technique("efficientnet", **wrong)


def test_weights_may_be_a_path(tmp_path: Path) -> None:
    assert rt.technique("efficientnet", weights=tmp_path).parameters.weights == str(tmp_path)


def test_clean_pictures_by_other_weights(tmp_path: Path) -> None:
    """Tuned weights serve pictures that JPEG has harmed; the others go to the untuned network."""
    untuned = write_tiny_weights(tmp_path / "untuned.safetensors", seed=0)
    tuned = write_tiny_weights(tmp_path / "tuned.safetensors", seed=1)
    both = with_weights(tuned, clean_weights=str(untuned))
    clean = photographs()
    harmed = [through_jpeg(picture, 97) for picture in clean]
    images = [clean[0], harmed[0], harmed[1], clean[1], clean[2]]
    wanted = (untuned, tuned, tuned, untuned, untuned)
    for image, weights, described in zip(images, wanted, both.describe_batch(images), strict=True):
        alone = with_weights(weights, clean_weights="same").describe(image)["descriptor"]
        np.testing.assert_allclose(described["descriptor"], alone, atol=1e-6)
        np.testing.assert_allclose(both.describe(image)["descriptor"], alone, atol=1e-6)


def test_weights_say_which_weights_serve_clean_pictures(tmp_path: Path) -> None:
    untuned = write_tiny_weights(tmp_path / "untuned.safetensors", seed=0)
    tuned = write_tiny_weights(tmp_path / "tuned.safetensors", seed=1)
    plain = with_weights(tuned)
    assert plain.for_clean_pictures() is None
    saying = tmp_path / "saying.safetensors"
    save_file(load_file(tuned), saying, {CLEAN_WEIGHTS: str(untuned)})
    other = with_weights(saying).for_clean_pictures()
    assert other is not None
    assert other.fingerprint() == with_weights(untuned).fingerprint()
    assert with_weights(saying, clean_weights="same").for_clean_pictures() is None
    # Another way to describe clean pictures is another technique.
    assert len({with_weights(saying).fingerprint(), file_digest(saying), file_digest(tuned)}) == 3


def test_weights_for_clean_pictures_that_are_not_here(tmp_path: Path) -> None:
    tuned = write_tiny_weights(tmp_path / "tuned.safetensors")
    technique = with_weights(tuned, clean_weights="nowhere")
    with pytest.raises(DataMissingError, match="nowhere"):
        technique.describe(photographs()[0])


def photographs() -> list[ImageArray]:
    names = ("astronaut", "chelsea", "coffee")
    return [np.ascontiguousarray(getattr(data, name)()[::3, ::3]) for name in names]


def through_jpeg(picture: ImageArray, compression: int) -> ImageArray:
    return decode_bgr(encode_jpeg(picture, compression))[..., ::-1]
