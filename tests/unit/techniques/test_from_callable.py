"""A Python function as a technique: described, matched, kept in a map, opened with it again."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import retraverse as rt
from retraverse.errors import ConfigError, InputError, MapError
from retraverse.images import Frame
from retraverse.types import ImageArray


def tiny(image: ImageArray) -> Any:
    """Return the mean colours of a 2 x 2 grid."""
    h, w = image.shape[0] // 2, image.shape[1] // 2
    return np.stack([image[:h, :w], image[:h, -w:], image[-h:, :w], image[-h:, -w:]]).mean((1, 2))


def frames(n: int = 6) -> list[Frame]:
    random = np.random.default_rng(4)
    made = []
    for index in range(n):
        coarse = random.integers(0, 256, (2, 2, 3)).astype(np.uint8)
        pixels = np.kron(coarse, np.ones((12, 16, 1), np.uint8))
        made.append(Frame.from_array(pixels, name=f"{index}.png", index=index))
    return made


def drive() -> rt.Traverse:
    return rt.open_traverse([frame.colour() for frame in frames()])


def test_function_is_a_technique() -> None:
    mine = rt.technique_from_callable(tiny, name="tiny", version=3)
    assert (mine.name, mine.version, mine.layout.dimension) == ("callable:tiny", 3, 12)
    image = frames()[0].colour()
    vector = mine.describe(image)["descriptor"]
    expected = tiny(image).ravel()
    np.testing.assert_allclose(vector, expected / np.linalg.norm(expected), rtol=1e-6)


def test_grey_pictures_and_said_length() -> None:
    def length_unknown_to_noise(image: ImageArray) -> Any:
        assert image.ndim == 2
        assert image.shape == (24, 32)
        return image.mean(axis=0)

    mine = rt.technique_from_callable(
        length_unknown_to_noise, name="columns", picture="grey", dimension=32
    )
    frame = frames(1)[0]
    assert mine.describe(mine.read(frame))["descriptor"].shape == (32,)


def test_own_measure() -> None:
    def closeness(queries: Any, references: Any) -> Any:
        return -np.abs(queries[:, None] - references[None]).sum(axis=2)

    mine = rt.technique_from_callable(tiny, name="tiny", similarity=closeness)
    route = rt.build_map(frames(), mine)
    scores = rt.similarity(drive(), route)
    assert scores.dtype == np.float32
    np.testing.assert_array_equal(np.diag(scores), np.zeros(6))
    assert (scores.argmax(axis=1) == np.arange(6)).all()
    wrong = rt.technique_from_callable(tiny, name="tiny", similarity=lambda q, r: np.zeros(3))
    with pytest.raises(InputError, match=r"gave shape \(3,\), expected \(6, 6\)"):
        rt.similarity(drive(), rt.build_map(frames(), wrong))


def test_map_is_opened_with_the_same_function(tmp_path: Path) -> None:
    def again(**changes: Any) -> Any:
        settings = {"name": "tiny", "version": 1, "settings": "2 x 2", **changes}
        return rt.technique_from_callable(tiny, **settings)

    path = tmp_path / "route.map"
    rt.build_map(frames(), again(), path=path)
    route = rt.load_map(path, technique=again())
    assert (rt.similarity(drive(), route).argmax(axis=1) == np.arange(6)).all()
    with pytest.raises(MapError, match=r"'tiny' is a Python function, .*load_map's technique"):
        rt.load_map(path)
    for changed in ({"version": 2}, {"name": "other"}, {"settings": "3 x 3"}, {"picture": "grey"}):
        with pytest.raises(MapError, match="made with callable:tiny"):
            rt.load_map(path, technique=again(**changed))


@pytest.mark.parametrize(
    ("gives", "message"),
    [
        (lambda image: "text", "gave str, expected numbers"),
        (lambda image: [1.0, float("nan")], "not all of them finite"),
        (lambda image: [], "gave 0 numbers"),
        (lambda image: [[1, 2], [3]], "expected numbers"),
    ],
)
def test_what_is_no_vector(gives: Any, message: str) -> None:
    mine = rt.technique_from_callable(gives, name="wrong", dimension=2)
    with pytest.raises(InputError, match=message):
        mine.describe(frames(1)[0].colour())


def test_length_must_not_depend_on_the_picture() -> None:
    mine = rt.technique_from_callable(lambda image: image[:, 0, 0], name="rows")
    with pytest.raises(InputError, match="got 24 numbers, expected 240"):
        mine.describe(frames(1)[0].colour())


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"name": ""}, "name of a technique"),
        ({"name": "a\n"}, "printable"),
        ({"name": "a", "version": 0}, "whole number from 1"),
        ({"name": "a", "version": True}, "whole number from 1"),
        ({"name": "a", "picture": "bgr"}, "expected 'colour' or 'grey'"),
    ],
)
def test_wrong_settings(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        rt.technique_from_callable(tiny, **settings)
    with pytest.raises(ConfigError, match="expected a callable"):
        rt.technique_from_callable(3, name="three")  # type: ignore[arg-type]


def test_functions_are_not_in_the_list() -> None:
    rt.technique_from_callable(tiny, name="tiny")
    assert not any(info.name.startswith("callable:") for info in rt.techniques())
    with pytest.raises(ConfigError, match="give the same one again"):
        rt.technique("callable:tiny")
