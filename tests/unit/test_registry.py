from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from retraverse.errors import ConfigError
from retraverse.registry import read_parameters


@dataclass(frozen=True)
class Parameters:
    count: int = 1
    gain: float = 0.5
    place: str = ""
    whiten: bool = False


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({"place": "a=b, c"}, "a=b, c"),
        ({"place": "3"}, "3"),
        ({"place": Path("a/b")}, "a/b"),
        ({"place": ""}, ""),
        ({"whiten": True}, True),
        ({"whiten": "Yes"}, True),
        ({"whiten": "True"}, True),
        ({"whiten": "off"}, False),
        ({"count": "3"}, 3),
        ({"gain": "0.25"}, 0.25),
    ],
)
def test_values_are_read_as_their_field(given: dict[str, Any], expected: Any) -> None:
    read = read_parameters("it", Parameters, given)
    (name,) = given
    assert getattr(read, name) == expected
    assert type(getattr(read, name)) is type(expected)


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"place": 3}, "it parameter 'place': got 3, expected text"),
        ({"place": b"x"}, "expected text"),
        ({"place": "a\x00b"}, "expected printable text"),
        ({"whiten": "perhaps"}, "got 'perhaps', expected one of true, yes"),
        ({"whiten": 1}, "expected one of true, yes"),
        ({"count": True}, "expected int"),
        ({"count": "1.5"}, "expected a whole number"),
        ({"gain": None}, "expected float"),
    ],
)
def test_values_that_cannot_be(given: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        read_parameters("it", Parameters, given)
