import io

import numpy as np
import pytest
from PIL import Image

from retraverse.errors import ConfigError
from retraverse.images.quantisation import STANDARD_TABLES, QuantisationTables, scaled_table


@pytest.mark.parametrize("quality", [1, 2, 3, 5, 10, 49, 50, 51, 75, 90, 99, 100])
def test_tables_at_a_quality_are_those_a_file_of_pillow_holds(quality: int) -> None:
    buffer = io.BytesIO()
    Image.fromarray(np.zeros((8, 8, 3), np.uint8)).save(buffer, "JPEG", quality=quality)
    held: dict[int, list[int]] = vars(Image.open(buffer))["quantization"]
    assert STANDARD_TABLES.at_quality(quality) == (tuple(held[0]), tuple(held[1]))


def test_every_quality_lies_between_its_neighbours() -> None:
    steps = np.array([scaled_table(STANDARD_TABLES.luminance, q) for q in range(1, 101)])
    assert (np.diff(steps, axis=0) <= 0).all()
    assert steps.min() == 1
    assert steps.max() == 255


@pytest.mark.parametrize("quality", [0, -1, 101])
def test_a_quality_out_of_range(quality: int) -> None:
    with pytest.raises(ConfigError, match=f"JPEG quality: got {quality}, expected 1 to 100"):
        scaled_table(STANDARD_TABLES.luminance, quality)


@pytest.mark.parametrize(
    ("steps", "reason"),
    [
        ((1,) * 63, "luminance table: got 63 steps, expected 64"),
        ((0,) * 64, "luminance table: expected whole steps from 1 to 32767"),
        ((1,) * 63 + (40000,), "luminance table: expected whole steps from 1 to 32767"),
        ((1.5,) * 64, "luminance table: expected whole steps from 1 to 32767"),
    ],
)
def test_tables_that_are_none(steps: tuple[int, ...], reason: str) -> None:
    with pytest.raises(ConfigError, match=reason):
        QuantisationTables(steps, STANDARD_TABLES.chrominance)


def test_labels_tell_tables_apart() -> None:
    other = (17, *STANDARD_TABLES.luminance[1:])
    labels = {
        STANDARD_TABLES.label,
        QuantisationTables(other, STANDARD_TABLES.chrominance, "standard").label,
        QuantisationTables(STANDARD_TABLES.luminance, STANDARD_TABLES.chrominance, "mine").label,
    }
    assert len(labels) == 3
    assert all(label.startswith(("standard-", "mine-")) for label in labels)
