"""The byte form of a group: what goes in comes out, and a cut is noticed."""

import pytest

from retraverse.errors import InputError
from retraverse.images.group_bytes import LONGEST_SIDE, GroupHead, join_group, split_group

PACKETS = [b"first", b"\x00" * 300, b"x"]


@pytest.mark.parametrize(
    "head",
    [
        GroupHead("h265", grey=True, height=64, width=300, n_pictures=3),
        GroupHead("av1", grey=False, height=LONGEST_SIDE, width=1, n_pictures=1000),
    ],
)
def test_head_and_packets_come_back(head: GroupHead) -> None:
    assert split_group(join_group(head, PACKETS)) == (head, PACKETS)
    assert split_group(join_group(head, [])) == (head, [])


def test_its_form_is_fixed() -> None:
    head = GroupHead("av1", grey=True, height=2, width=259, n_pictures=1)
    assert join_group(head, [b"ab"]) == b"GOP1\x01\x01\x00\x02\x01\x03\x00\x01\x00\x00\x02ab"


def test_a_cut_within_a_packet_is_noticed() -> None:
    head = GroupHead("h265", grey=False, height=64, width=64, n_pictures=3)
    group = join_group(head, PACKETS)
    ends, at = {12}, 12
    for packet in PACKETS:
        at += 3 + len(packet)
        ends.add(at)
    for length in range(len(group)):
        if length in ends:
            split_group(group[:length])  # the head says how many pictures there should be
            continue
        with pytest.raises(InputError):
            split_group(group[:length])
