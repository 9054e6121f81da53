"""What the techniques with classic networks promise, with seeded weights in place of trained."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from tests.unit.techniques.seeded_weights import MAKERS, SMALL, seeded_parameters
from tests.unit.techniques.tiny_network import pictures

import retraverse as rt
from retraverse.errors import DataMissingError, InputError
from retraverse.techniques import Descriptions, Technique
from retraverse.types import ImageArray

NAMES = sorted(MAKERS)
LENGTHS = {
    "alexnet": 1064, "amosnet": 7680, "binarynet": 9216, "calc": 1064, "floppynet": 9216,
    "hybridnet": 7680, "mobilenetv2_netvlad": 1024, "netvlad": 4096, "regionvlad": 256 * 384,
    "shallownet": 9216,
}  # fmt: skip
"""As the sources say: numbers in a descriptor with default parameters."""
RAW = {"amosnet", "hybridnet"}
"""Compared by absolute differences, not by the cosine."""


@pytest.fixture(scope="module", params=NAMES)
def technique(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> Technique:
    folder = tmp_path_factory.mktemp(request.param)
    return rt.technique(request.param, **seeded_parameters(request.param, folder))


@pytest.fixture(scope="module")
def described(technique: Technique) -> Descriptions:
    return describe(technique, pictures(3))


def describe(technique: Technique, images: list[ImageArray]) -> Descriptions:
    return Descriptions.stack((technique.describe(image) for image in images), technique.layout)


@pytest.mark.parametrize("name", NAMES)
def test_the_length_is_the_published_one_and_known_before_any_weights(name: str) -> None:
    assert rt.technique(name).layout.dimension == LENGTHS[name]


def test_a_description_is_as_promised(technique: Technique, described: Descriptions) -> None:
    assert described.descriptor.shape == (3, technique.layout.dimension)
    assert np.isfinite(described.descriptor).all()
    lengths = np.linalg.norm(described.descriptor, axis=1)
    assert (lengths > 0).all()
    if technique.name not in RAW:
        np.testing.assert_allclose(lengths, 1, atol=1e-5)


def test_places_differ_and_are_like_themselves(
    technique: Technique, described: Descriptions
) -> None:
    scores = technique.similarity(described, described)
    np.testing.assert_allclose(np.diag(scores), 1, atol=1e-5)
    assert (scores.argmax(axis=1) == np.arange(3)).all()
    order = np.array([2, 0, 1])
    shuffled = Descriptions({"descriptor": described.descriptor[order]})
    np.testing.assert_allclose(
        technique.similarity(described, shuffled), scores[:, order], atol=1e-5
    )


def test_the_same_again_and_in_a_batch(technique: Technique, described: Descriptions) -> None:
    again = describe(technique, pictures(3)[:1])
    np.testing.assert_array_equal(again.descriptor, described.descriptor[:1])
    batch = technique.describe_batch(pictures(3))  # type: ignore[attr-defined]
    for one, expected in zip(batch, described.descriptor, strict=True):
        np.testing.assert_allclose(one["descriptor"], expected, rtol=1e-4, atol=1e-5)


def test_a_picture_of_one_colour_is_nowhere(technique: Technique, described: Descriptions) -> None:
    flat = describe(technique, [np.full((30, 40, 3), 255, np.uint8)])
    assert not flat.descriptor.any()
    assert not technique.similarity(flat, described).any()
    assert not technique.similarity(described, flat).any()


@pytest.mark.parametrize("name", [*NAMES, "deepseqslam"])
def test_missing_weights_are_one_line_of_what_to_do(
    name: str, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("RETRAVERSE_WEIGHTS", str(tmp_path))
    technique = rt.technique(name, **{k: v for k, v in SMALL.get(name, {}).items() if k == "mean"})
    with pytest.raises(DataMissingError, match=r"retraverse (weights get|train)") as caught:
        technique.fingerprint()  # type: ignore[attr-defined]
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", [name for name in NAMES if name != "calc"])
def test_weights_of_another_network_are_refused(name: str, tmp_path: Path) -> None:
    wrong = seeded_parameters("calc", tmp_path)["weights"]
    technique = rt.technique(name, **{**SMALL.get(name, {}), "weights": wrong})
    with pytest.raises(InputError):
        technique.describe(pictures(1)[0])


def test_listing_and_layouts_need_no_torch() -> None:
    program = (
        "import sys; import retraverse as rt; "
        "names = [info.name for info in rt.techniques()]; "
        "[rt.technique(name).layout.dimension for name in names if name not in ('onnx',)]; "
        "print([m for m in ('torch', 'onnxruntime', 'scipy') if m in sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=False
    )
    assert (done.stdout, done.stderr) == ("[]\n", "")
