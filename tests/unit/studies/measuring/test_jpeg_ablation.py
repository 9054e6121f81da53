import numpy as np
import pytest

from retraverse.datasets import aligned
from retraverse.errors import ConfigError, InputError
from retraverse.studies.measuring.jpeg_ablation import ABLATED_PARTS, ablate
from retraverse.techniques import technique
from retraverse.types import ImageArray


def drive(seed: int, n: int = 7) -> list[ImageArray]:
    """Return places of random patches, seen with other noise by every seed."""
    places = np.random.default_rng(0).integers(40, 216, (n, 6, 8, 3)).astype(float)
    noise = np.random.default_rng(seed).normal(0, 6, (n, 48, 64, 3))
    patches = places.repeat(8, axis=1).repeat(8, axis=2)
    return list(np.clip(patches + noise, 0, 255).astype(np.uint8))


def test_every_part_is_compared_window_by_window() -> None:
    techniques = {"patchnorm": technique("patchnorm")}
    points = ablate(
        drive(1), drive(2), aligned(7, 7, 0), techniques, compression=97, sequence_lengths=(1, 3)
    )
    assert len(points) == 2 * len(ABLATED_PARTS)
    clean = {point.sequence_length: point for point in points if point.part == "clean"}
    assert clean[1].accuracy == 1
    for point in points:
        assert len(point.correct) == 7 - point.sequence_length + 1
        assert point.change == pytest.approx(point.accuracy - clean[point.sequence_length].accuracy)
        low, high = point.interval
        assert low <= point.change <= high
    assert all(point.change == 0 for point in points if point.part == "clean")


def test_means_of_blocks_suffice_where_places_are_made_of_blocks() -> None:
    techniques = {"sad": technique("sad")}
    chosen = [part for part in ABLATED_PARTS if part.name == "1 bands in blocks"]
    (point,) = ablate(
        drive(1),
        drive(2),
        aligned(7, 7, 0),
        techniques,
        sequence_lengths=[1],
        chosen=chosen,
    )
    assert point.accuracy == 1


def test_names_are_unique_and_said() -> None:
    names = [part.name for part in ABLATED_PARTS]
    assert len(set(names)) == len(names)
    assert names[0] == "clean"
    assert all(part.summary for part in ABLATED_PARTS)


def test_truth_of_another_drive_and_c_out_of_range() -> None:
    techniques = {"sad": technique("sad")}
    with pytest.raises(InputError, match="truth: got 6 queries, expected 7"):
        ablate(drive(1), drive(2), aligned(6, 7, 0), techniques)
    with pytest.raises(ConfigError, match="compression: got 100"):
        ablate(drive(1), drive(2), aligned(7, 7, 0), techniques, compression=100)
