"""The catalogue: complete, well-formed, and with the published figures."""

import re

import pytest

from retraverse.errors import ConfigError
from retraverse.weights.catalogue import catalogue, is_catalogued, weight_entry

ENTRIES = catalogue()


@pytest.mark.parametrize("entry", ENTRIES, ids=lambda entry: entry.name)
def test_entry_says_all_it_must(entry: object) -> None:
    from retraverse.weights.catalogue import WeightEntry
    from retraverse.weights.records import is_name

    assert isinstance(entry, WeightEntry)
    assert is_name(entry.name)
    assert entry.name == entry.name.lower()
    assert entry.technique.isidentifier()
    assert entry.licence
    assert re.search(r"(19|20)\d\d", entry.citation)
    assert entry.format in {"caffemodel", "matlab", "keras", "torch", "tflite", "npz"}
    assert "/" not in entry.file_name
    assert entry.addresses or entry.package
    assert all(address.startswith(("http://", "https://")) for address in entry.addresses)
    for digits, digest in ((64, entry.sha256), (40, entry.sha1), (40, entry.git_blob)):
        assert digest is None or re.fullmatch(rf"[0-9a-f]{{{digits}}}", digest)


def test_names_and_files_are_unique() -> None:
    assert len({entry.name for entry in ENTRIES}) == len(ENTRIES)
    assert len({entry.file_name for entry in ENTRIES}) == len(ENTRIES)


def test_published_figures() -> None:
    alexnet = weight_entry("alexnet")
    assert alexnet.n_bytes == 243_862_414
    assert alexnet.sha1 == "9116a64c0fbe4459d18f4bb6b56d647b63920377"
    # 4 + 5 + 3 * 7 and 1 + 2 + 2 * 5: what the two release pages hold.
    assert sum(entry.technique == "cosplace" for entry in ENTRIES) == 30
    assert sum(entry.technique == "eigenplaces" for entry in ENTRIES) == 13
    assert weight_entry("cosplace-resnet50-2048").addresses == (
        "https://github.com/gmberton/CosPlace/releases/download/v1.0/ResNet50_2048_cosplace.pth",
    )


def test_checksums_of_members_are_not_those_of_archives() -> None:
    calc = weight_entry("calc")
    assert not calc.file_seal.has_checksum
    assert calc.member_seal.git_blob == "bc5f708a6b2f85a771af43182e3228880464078c"
    plain = weight_entry("binarynet")
    assert plain.file_seal == plain.member_seal == plain.seal


def test_unknown_name_names_the_nearest() -> None:
    assert not is_catalogued("cosplace-resnet50-513")
    with pytest.raises(ConfigError, match=r"did you mean 'cosplace-resnet50-512'"):
        weight_entry("cosplace-resnet50-513")
