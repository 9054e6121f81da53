"""What every registered technique promises; a new technique is one row here: none, it is found."""

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import FrozenInstanceError, fields
from pathlib import Path

import numpy as np
import pytest

import retraverse as rt
from retraverse.errors import ConfigError, DataMissingError
from retraverse.images import Frame
from retraverse.techniques import (
    BatchTechnique,
    Descriptions,
    FingerprintedTechnique,
    Technique,
)
from retraverse.techniques.running.learned import LearnedTechnique

NAMES = [info.name for info in rt.techniques()]
WITH_WEIGHTS = [
    info.name
    for info in rt.techniques()
    if "weights" in {parameter.name for parameter in info.parameters}
]
WEIGHT_FILES = {
    "squeezenet": "weights/squeezenet/squeezenet_v1.0.npz",
}
"""Weights that no package brings, where data lie beside the project."""
DATA = Path(os.environ.get("RETRAVERSE_DATA", Path(__file__).parents[3] / "shared" / "data"))


def with_weights(name: str) -> Technique:
    """Return a technique with its default weights, or those beside the project."""
    file = DATA.resolve().parent / WEIGHT_FILES.get(name, "nothing")
    return rt.technique(name, **({"weights": file} if file.is_file() else {}))


def can_run(name: str) -> bool:
    """Tell whether all that a technique needs is here: none is downloaded for a test."""
    technique = with_weights(name)
    try:
        return not isinstance(technique, FingerprintedTechnique) or bool(technique.fingerprint())
    except DataMissingError:
        return False


def pictures() -> list[Frame]:
    """Return six different places: blocks of texture, seeded."""
    frames = []
    for seed in range(6):
        random = np.random.default_rng(seed)
        coarse = random.integers(0, 256, (12, 16, 3)).astype(np.uint8)
        picture = np.kron(coarse, np.ones((10, 10, 1), np.uint8))
        picture = picture // 2 + random.integers(0, 120, picture.shape).astype(np.uint8)
        frames.append(Frame.from_array(picture, name=f"{seed}.png", index=seed))
    return frames


def describe(technique: Technique, frames: list[Frame]) -> Descriptions:
    return Descriptions.stack(
        (technique.describe(technique.read(frame)) for frame in frames), technique.layout
    )


@pytest.fixture(scope="module", params=[name for name in NAMES if can_run(name)])
def technique(request: pytest.FixtureRequest) -> Technique:
    return with_weights(request.param)


@pytest.fixture(scope="module")
def described(technique: Technique) -> Descriptions:
    return describe(technique, pictures())


def test_listing_says_what_it_is() -> None:
    for info in rt.techniques():
        assert info.name
        assert info.summary
        assert "," in info.citation
        assert info.version >= 1
        assert all(parameter.help for parameter in info.parameters)


def test_description_is_as_the_layout_promises(
    technique: Technique, described: Descriptions
) -> None:
    assert len(described) == 6
    for name, spec in technique.layout.arrays.items():
        assert described.arrays[name].shape == (6, *spec.shape)
        assert described.arrays[name].dtype == np.dtype(spec.dtype)
        assert np.isfinite(described.arrays[name]).all()
    assert technique.layout.dimension > 0
    assert technique.layout.descriptor.n_bytes == described.descriptor[0].nbytes


def test_every_place_is_most_like_itself(technique: Technique, described: Descriptions) -> None:
    scores = technique.similarity(described, described)
    assert scores.shape == (6, 6)
    assert scores.dtype == np.float32
    assert (scores.argmax(axis=1) == np.arange(6)).all()
    assert scores.min() >= -1
    assert scores.max() <= 1 + 1e-3
    np.testing.assert_allclose(np.diag(scores), 1, atol=5e-3)


def test_similarity_follows_the_order_of_references(
    technique: Technique, described: Descriptions
) -> None:
    order = np.array([3, 0, 5, 1, 4, 2])
    shuffled = Descriptions({name: array[order] for name, array in described.arrays.items()})
    scores = technique.similarity(described, described)
    moved = technique.similarity(described, shuffled)
    np.testing.assert_allclose(moved, scores[:, order], atol=1e-5)


def test_same_picture_same_bytes_on_any_thread(
    technique: Technique, described: Descriptions
) -> None:
    frames = pictures()
    with ThreadPoolExecutor(4) as pool:
        again = Descriptions.stack(
            pool.map(lambda frame: technique.describe(technique.read(frame)), frames),
            technique.layout,
        )
    for name, array in described.arrays.items():
        np.testing.assert_array_equal(again.arrays[name], array)


@pytest.mark.parametrize("value", [0, 255], ids=["black", "white"])
def test_flat_pictures_have_no_place(technique: Technique, value: int) -> None:
    flat = Frame.from_array(np.full((30, 40, 3), value, np.uint8), name="flat", index=0)
    described = describe(technique, [flat])
    scores = technique.similarity(described, describe(technique, pictures()))
    assert np.isfinite(scores).all()
    assert np.ptp(scores) <= 1e-6


@pytest.mark.parametrize("shape", [(1, 1), (1, 50, 3), (700, 33), (48, 64, 3)])
def test_any_size_of_picture(technique: Technique, shape: tuple[int, ...]) -> None:
    random = np.random.default_rng(7).integers(0, 256, shape).astype(np.uint8)
    described = describe(technique, [Frame.from_array(random, name="odd", index=0)])
    assert np.isfinite(described.descriptor).all()


def test_batches_are_as_one_by_one(technique: Technique, described: Descriptions) -> None:
    if not isinstance(technique, BatchTechnique):
        pytest.skip(f"{technique.name} describes one picture at a time")
    images = [technique.read(frame) for frame in pictures()]
    together = Descriptions.stack(technique.describe_batch(images), technique.layout)
    for name, array in described.arrays.items():
        np.testing.assert_allclose(together.arrays[name], array, atol=2e-5)


@pytest.mark.parametrize("name", WITH_WEIGHTS)
def test_missing_weights_are_one_line_once_they_are_needed(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("RETRAVERSE_WEIGHTS", str(tmp_path))
    technique = rt.technique(name, weights="never-heard-of")
    assert hasattr(technique, "fingerprint")
    wanted: list[Callable[[], object]] = [technique.fingerprint]
    if isinstance(technique, LearnedTechnique):
        wanted.append(lambda: describe(technique, pictures()[:1]))
    if name != "onnx":  # what its graph gives is in the file alone
        assert technique.layout.dimension > 0
    for ask in wanted:
        with pytest.raises(DataMissingError, match=r"weights|no file|bring") as caught:
            ask()
        assert "\n" not in str(caught.value)


def test_some_learned_technique_runs_as_installed() -> None:
    assert can_run("efficientnet")


def test_no_frames_are_no_rows(technique: Technique, described: Descriptions) -> None:
    nobody = described[:0]
    assert technique.similarity(nobody, described).shape == (0, 6)
    assert technique.similarity(described, nobody).shape == (6, 0)


def test_parameters_are_checked_by_name(technique: Technique) -> None:
    with pytest.raises(ConfigError, match="expected one of"):
        rt.technique(technique.name, no_such_parameter=1)
    first = fields(technique.parameters)[0].name
    with pytest.raises(FrozenInstanceError):
        setattr(technique.parameters, first, None)


def test_unknown_technique_names_the_known_ones() -> None:
    with pytest.raises(ConfigError, match=r"cohog.*did you mean 'hog'"):
        rt.technique("hogg")


def test_parameters_may_come_as_text(technique: Technique) -> None:
    from dataclasses import asdict

    texts = {name: str(value) for name, value in asdict(technique.parameters).items()}
    assert rt.technique(technique.name, **texts).parameters == technique.parameters
