import numpy as np
import pytest

from retraverse.errors import MapError
from retraverse.maps.ragged import check_ragged, pack, unpack


@pytest.mark.parametrize("strings", [[], [b""], [b"one"], [b"", b"a\0b", b"", b"longer"]])
def test_unpack_gives_back_what_pack_got(strings: list[bytes]) -> None:
    text, ends = pack(strings)
    check_ragged(text, ends, "names")
    assert [unpack(text, ends, row) for row in range(len(strings))] == strings
    assert len(text) == sum(map(len, strings))


@pytest.mark.parametrize("ends", [[], [2], [4], [3, 2, 3], [-1, 3], [3, 4]])
def test_ends_that_do_not_fit_are_refused(ends: list[int]) -> None:
    with pytest.raises(MapError, match="names: its ends do not fit its 3 bytes"):
        check_ragged(np.zeros(3, np.uint8), np.array(ends, np.int64), "names")
