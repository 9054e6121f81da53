"""CosPlace and its successors as techniques: preparation, official files, missing weights."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import retraverse as rt
from retraverse.errors import ConfigError, DataMissingError, InputError
from retraverse.types import ImageArray

torch = pytest.importorskip("torch", reason="the extra 'learned' is not installed")

from tests.unit.techniques.networks import checkpoints  # noqa: E402

SMALL = (64, 2, 9)


@pytest.fixture(autouse=True)
def _small(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[None]:
    """Shrink DINOv2, and empty the store."""
    from retraverse.techniques.networks import boq, salad
    from retraverse.techniques.networks.dinov2 import DinoV2

    def small() -> DinoV2:
        return DinoV2(width=64, depth=2, heads=2, grid=9)

    monkeypatch.setattr(boq, "DinoV2", small)
    monkeypatch.setattr(salad, "DinoV2", small)
    monkeypatch.setenv("RETRAVERSE_WEIGHTS", str(tmp_path / "store"))
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(before)


def picture(seed: int, height: int = 60, width: int = 90) -> ImageArray:
    coarse = np.random.default_rng(seed).integers(0, 256, (6, 9, 3)).astype(np.uint8)
    return np.kron(coarse, np.ones((height // 6, width // 9, 1), np.uint8))


OFFICIAL: dict[str, tuple[checkpoints.Shapes, dict[str, Any], int]] = {
    "cosplace": (checkpoints.geo("ResNet18", 32), {"backbone": "ResNet18", "dimension": 32}, 32),
    "mixvpr": (checkpoints.mixvpr(64, 2), {"dimension": 128}, 128),
    "salad": (checkpoints.salad(*SMALL), {"resolution": 126}, 8448),
    "boq": (checkpoints.boq("dinov2", SMALL), {"backbone": "dinov2", "resolution": 126}, 12288),
}


@pytest.fixture(scope="module")
def official(tmp_path_factory: pytest.TempPathFactory) -> Callable[[str], Path]:
    """Return a function that gives the path of a checkpoint as its authors write it."""
    folder = tmp_path_factory.mktemp("official")

    def find(name: str) -> Path:
        file = folder / f"{name}.pth"
        if not file.is_file():
            arrays = checkpoints.seeded(OFFICIAL[name][0])
            torch.save({key: torch.from_numpy(np.asarray(a)) for key, a in arrays.items()}, file)
        return file

    return find


@pytest.mark.parametrize("name", OFFICIAL)
def test_official_file_to_unit_vector(name: str, official: Callable[[str], Path]) -> None:
    _, parameters, dimension = OFFICIAL[name]
    technique = rt.technique(name, weights=official(name), **parameters)
    assert technique.layout.descriptor.shape == (dimension,)
    vectors = [technique.describe(picture(seed))["descriptor"] for seed in (1, 2)]
    for vector in vectors:
        assert vector.shape == (dimension,)
        assert vector.dtype == np.float32
        assert np.linalg.norm(vector) == pytest.approx(1, abs=1e-5)
    assert vectors[0] @ vectors[1] < 0.9999
    assert not technique.describe(np.full((60, 90, 3), 7, np.uint8))["descriptor"].any()


def test_eigenplaces_is_cosplaces_network(official: Callable[[str], Path]) -> None:
    settings = {"backbone": "ResNet18", "dimension": 32, "weights": official("cosplace")}
    one, other = (rt.technique(name, **settings) for name in ("cosplace", "eigenplaces"))
    np.testing.assert_array_equal(
        one.describe(picture(1))["descriptor"], other.describe(picture(1))["descriptor"]
    )


def test_megaloc_fills_its_network(monkeypatch: pytest.MonkeyPatch) -> None:
    from retraverse.techniques.networks import salad

    whole = salad.MegaLocNet
    # 24 numbers in place of 8448: the last layer alone would be half a gigabyte of noise.
    monkeypatch.setattr(salad, "MegaLocNet", lambda: whole(dimension=24))
    technique = rt.technique("megaloc", resolution=126)
    arrays = checkpoints.seeded(checkpoints.megaloc(*SMALL, dimension=24))
    network = technique.build_network(arrays).eval()  # type: ignore[attr-defined]
    prepared = technique.prepare(picture(1))[None]  # type: ignore[attr-defined]
    with torch.inference_mode():
        assert network(torch.from_numpy(prepared)).shape == (1, 24)


def test_stored_release_is_found_by_backbone_and_dimension(
    official: Callable[[str], Path], tmp_path: Path
) -> None:
    from retraverse.weights import import_weights

    file = tmp_path / "ResNet18_32_cosplace.pth"
    file.hardlink_to(official("cosplace"))
    assert import_weights(file).name == "cosplace-resnet18-32.safetensors"
    stored = rt.technique("cosplace", backbone="ResNet18", dimension=32)
    direct = rt.technique("cosplace", backbone="ResNet18", dimension=32, weights=file)
    np.testing.assert_array_equal(
        stored.describe(picture(1))["descriptor"], direct.describe(picture(1))["descriptor"]
    )
    other = rt.technique("cosplace", backbone="ResNet18", dimension=64, weights=file)
    with pytest.raises(InputError, match=r"'aggregation\.3\.weight' has shape \(32, 512\)"):
        other.describe(picture(1))


def test_pictures_of_any_size_in_one_batch(official: Callable[[str], Path]) -> None:
    technique = rt.technique(
        "cosplace", backbone="ResNet18", dimension=32, weights=official("cosplace"), batch=4
    )
    pictures = [picture(1), picture(2, 66, 45), picture(3)]
    batch = technique.describe_batch(pictures)  # type: ignore[attr-defined]
    for one, image in zip(batch, pictures, strict=True):
        np.testing.assert_allclose(
            one["descriptor"], technique.describe(image)["descriptor"], atol=1e-6
        )


@pytest.mark.parametrize(
    ("name", "parameters", "advice"),
    [
        ("cosplace", {}, "retraverse weights get cosplace-resnet50-512"),
        ("cosplace", {"backbone": "VGG16"}, "get cosplace-vgg16-512"),
        ("eigenplaces", {}, "get eigenplaces-resnet50-2048"),
        ("mixvpr", {"dimension": 512}, "get mixvpr-512"),
        ("salad", {}, "get salad"),
        ("megaloc", {}, "get megaloc"),
        ("boq", {}, "get boq-resnet50-16384"),
        ("boq", {"backbone": "dinov2"}, "get boq-dinov2-12288"),
    ],
)
def test_missing_weights_say_what_to_run(
    name: str, parameters: dict[str, str], advice: str
) -> None:
    technique = rt.technique(name, **parameters)
    assert technique.layout.dimension > 0
    with pytest.raises(DataMissingError, match=advice):
        technique.describe(picture(1))


@pytest.mark.parametrize(
    ("name", "parameters", "shape"),
    [
        ("cosplace", {}, (3, 60, 90)),
        ("cosplace", {"resolution": 512}, (3, 512, 512)),
        ("mixvpr", {}, (3, 320, 320)),
        ("salad", {}, (3, 322, 322)),
        ("boq", {}, (3, 384, 384)),
        ("boq", {"backbone": "dinov2"}, (3, 322, 322)),
        ("megaloc", {}, (3, 322, 322)),
        ("megaloc", {"resolution": 0}, (3, 126, 126)),
    ],
)
def test_sizes_as_published(name: str, parameters: dict[str, int], shape: tuple[int, ...]) -> None:
    assert rt.technique(name, **parameters).prepare(picture(1)).shape == shape  # type: ignore[attr-defined]


def test_megaloc_goes_to_the_nearest_multiple_of_14() -> None:
    technique = rt.technique("megaloc", resolution=0)
    tall = np.zeros((480, 640, 3), np.uint8)
    assert technique.prepare(tall).shape == (3, 476, 644)  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("name", "parameters", "message"),
    [
        ("cosplace", {"backbone": "VGG16", "dimension": 2048}, "expected one of 64, 128, 256, 512"),
        ("cosplace", {"runtime": "onnx"}, "expected a size such as 512"),
        ("cosplace", {"resolution": 8}, "expected 32 to 4096"),
        ("eigenplaces", {"backbone": "ResNet18", "dimension": 128}, "expected one of 256, 512"),
        ("eigenplaces", {"backbone": "ResNet152"}, "expected one of 'VGG16'"),
        ("mixvpr", {"dimension": 300}, "expected one of 4096, 512, 128"),
        ("salad", {"resolution": 320}, "multiple of 14"),
        ("megaloc", {"resolution": 112}, "expected 126 to 1022"),
        ("boq", {"backbone": "dinov2", "resolution": 384}, "multiple of 14"),
    ],
)
def test_settings_that_were_never_published(
    name: str, parameters: dict[str, object], message: str
) -> None:
    with pytest.raises(ConfigError, match=message):
        rt.technique(name, **parameters)


def test_own_weights_may_have_any_length() -> None:
    assert rt.technique("cosplace", dimension=77, weights="mine").layout.dimension == 77


def test_released_sizes_are_all_in_the_catalogue() -> None:
    from retraverse.weights.catalogue import catalogue

    backbones = ("VGG16", "ResNet18", "ResNet50", "ResNet101", "ResNet152")
    official = {backbone.lower(): backbone for backbone in backbones}
    for entry in catalogue():
        if entry.technique in ("cosplace", "eigenplaces"):
            _, backbone, dimension = entry.name.split("-")
            technique = rt.technique(
                entry.technique, backbone=official[backbone], dimension=dimension
            )
            assert technique.layout.dimension == int(dimension)
