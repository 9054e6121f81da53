"""GIST against its definition, written with explicit Fourier sums in float64.

No fast Fourier transform, no cropping, no frequency shift: every sum of waves is a product with
the matrix of all waves, and filters are functions of the complex frequency.
"""

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import retraverse as rt
from retraverse.techniques.handmade.gist_filters import LowPass

Shared = Callable[[str], Path]


def waves(n: int) -> tuple[Any, Any]:
    """Return the matrix of all n waves at all n places, and each wave's whole frequency."""
    whole = np.array([k if k < n / 2 else k - n for k in range(n)])
    return np.exp(-2j * math.pi * np.outer(whole, np.arange(n)) / n), whole


def filtered(picture: Any, *gains: Callable[[Any], Any]) -> Iterator[Any]:
    """Yield the picture with each frequency (x real, y imaginary part) times its gain."""
    n = len(picture)
    matrix, whole = waves(n)
    spectrum = matrix @ picture @ matrix.T
    frequency = whole[np.newaxis, :] + 1j * whole[:, np.newaxis]
    for gain in gains:
        yield matrix.conj().T @ (spectrum * gain(frequency)) @ matrix.conj() / n**2


def local_mean(picture: Any) -> Any:
    return next(filtered(picture, lambda k: 0.5 ** (np.abs(k / 4) ** 2))).real


def oriented(scale: int, orientation: int, n: int) -> Callable[[Any], Any]:
    centre = 0.3 * n / 1.85**scale
    direction = np.exp(1j * math.pi * orientation / 8)

    def gain(k: Any) -> Any:
        away = np.abs(k) / centre - 1
        angle = np.angle(np.where(k == 0, 1, k) * direction)  # frequency 0 points along x
        return np.exp(-3.5 * away**2 - 2 * math.pi * angle**2)

    return gain


def slow_gist(grey: Any) -> Any:
    size = len(grey)
    levels = (grey - grey.min()) * (255 / (int(grey.max()) - int(grey.min())))
    logs = np.pad(np.log(1 + levels), 5, mode="symmetric")
    detail = logs - local_mean(logs)
    normal = detail / (0.2 + np.sqrt(np.abs(local_mean(detail**2))))
    mirrored = np.pad(normal[5:-5, 5:-5], 32, mode="symmetric")
    block = size // 4
    bank = [oriented(scale, way, size + 64) for scale in range(4) for way in range(8)]
    corners = [(y, x) for y in range(4) for x in range(4)]
    values = []
    for strength in map(np.abs, filtered(mirrored, *bank)):
        inner = strength[32 : 32 + size, 32 : 32 + size]
        for y, x in corners:
            part = inner[y * block : (y + 1) * block, x * block : (x + 1) * block]
            values.append(part.mean())
    return np.array(values) / math.sqrt(sum(value**2 for value in values))


def drawn(size: int, what: str) -> Any:
    random = np.random.default_rng(size)
    ramp = np.add.outer(np.arange(size) * 3, np.arange(size))
    return {
        "noise": random.integers(0, 256, (size, size)),
        "edge": np.tri(size) * 200 + 20,
        "dots": (random.random((size, size)) < 0.01) * 255,
        "ramp": ramp * 255 // ramp.max(),
        "checkerboard": np.indices((size, size)).sum(axis=0) % 2 * 255,
    }[what].astype(np.uint8)


def gist(grey: Any, transforms: str) -> Any:
    technique = rt.technique("gist", resolution=len(grey), transforms=transforms)
    return technique.describe(grey)["descriptor"]


@pytest.mark.parametrize("what", ["noise", "edge", "dots", "ramp", "checkerboard"])
@pytest.mark.parametrize("size", [16, 20, 48])
def test_in_full_it_is_the_definition(size: int, what: str) -> None:
    picture = drawn(size, what)
    np.testing.assert_allclose(gist(picture, "full"), slow_gist(picture), atol=1e-5)


@pytest.mark.parametrize(
    ("what", "largest", "cosine"),
    [
        ("noise", 1e-3, 0.99999),
        ("edge", 1e-3, 0.99999),
        ("dots", 1e-3, 0.99999),
        ("ramp", 1e-3, 0.99999),
        ("checkerboard", 4e-3, 0.9999),
    ],
)
@pytest.mark.parametrize("size", [84, 112])
def test_cropped_it_is_nearly_the_definition(
    size: int, what: str, largest: float, cosine: float
) -> None:
    picture = drawn(size, what)
    ours, expected = gist(picture, "cropped"), slow_gist(picture)
    assert np.abs(ours - expected).max() < largest
    assert float(ours @ expected) > cosine


@pytest.mark.parametrize("resolution", [32, 160])
@pytest.mark.parametrize("folder", ["corridor/query", "stromovka/snow"])
def test_photographs(shared: Shared, folder: str, resolution: int) -> None:
    frame = rt.open_traverse(shared(f"data/{folder}"))[37]
    technique = rt.technique("gist", resolution=resolution)
    from PIL import Image

    grey = np.asarray(Image.fromarray(frame.grey("from_colour")).resize((resolution, resolution)))
    ours, expected = technique.describe(technique.read(frame))["descriptor"], slow_gist(grey)
    assert np.abs(ours - expected).max() < 1e-3
    assert float(ours @ expected) > 0.99999


@pytest.mark.parametrize("side", [26, 27, 40, 41, 90])
def test_low_pass_is_the_periodic_gaussian(side: int) -> None:
    picture = np.random.default_rng(side).random((side, side)).astype(np.float32)
    passed: Any = LowPass(side)(picture)
    np.testing.assert_allclose(passed, local_mean(picture.astype(np.float64)), atol=2e-6)
