import hashlib
import json
from typing import Any

import pytest
from tests.unit.maps.fakes import FakeTechnique

from retraverse.errors import MapError
from retraverse.maps.manifest import Manifest, SegmentFile, is_segment_name
from retraverse.maps.provenance import Step, TechniqueRecord
from retraverse.maps.tensor_file import FileSeal
from retraverse.maps.thumbnails import ThumbnailSpec

NAME = "000000-0123456789abcdef.safetensors"
MANIFEST = Manifest(
    technique=TechniqueRecord.of(FakeTechnique()),
    history=(Step.now("build", "straße \udcff", 3), Step.now("extend", "more", 2)),
    content_sha256="0" * 64,
    position_columns=2,
    thumbnails=ThumbnailSpec(160),
    segments=(SegmentFile(NAME, 5, FileSeal(1000, "a" * 64)),),
)


def resealed(changes: dict[str, Any], *, remove: str = "") -> bytes:
    """Return the manifest with changes and the checksum that fits them: a forger's work."""
    record = {**json.loads(MANIFEST.render()), **changes}
    record.pop("checksum")
    record.pop(remove, None)
    text = (json.dumps(record, indent=1) + "\n").encode()
    record["checksum"] = hashlib.sha256(text).hexdigest()
    return (json.dumps(record, indent=1) + "\n").encode()


def test_parse_gives_back_what_render_got() -> None:
    assert Manifest.parse(MANIFEST.render(), "m") == MANIFEST
    assert Manifest.parse(resealed({}), "m") == MANIFEST
    assert MANIFEST.n_frames == 5


def test_every_single_byte_counts() -> None:
    content = MANIFEST.render()
    for place in range(len(content)):
        for mask in (0x01, 0x20):
            edited = bytearray(content)
            edited[place] ^= mask
            with pytest.raises(MapError):
                Manifest.parse(bytes(edited), "m")


def test_every_truncation_is_refused() -> None:
    content = MANIFEST.render()
    for length in range(len(content)):
        with pytest.raises(MapError):
            Manifest.parse(content[:length], "m")
    with pytest.raises(MapError):
        Manifest.parse(content + b"\n", "m")


@pytest.mark.parametrize(
    "content", [b"", b"{}", b"\x89PNG\r\n", b'{"format": "zarr"}', b"[" * 9999]
)
def test_foreign_files_say_so(content: bytes) -> None:
    with pytest.raises(MapError, match=r"^m: not the manifest of a retraverse map; wrong folder"):
        Manifest.parse(content, "m")


def test_a_newer_format_says_what_to_do() -> None:
    with pytest.raises(
        MapError, match="map format 2, this program reads format 1; install a newer"
    ):
        Manifest.parse(resealed({"format_version": 2, "segments": "new ways"}), "m")


def test_an_edit_by_hand_says_so() -> None:
    content = MANIFEST.render().replace(b'"max_side": 160', b'"max_side": 161')
    with pytest.raises(MapError, match="checksum does not fit; edited by hand, or damaged"):
        Manifest.parse(content, "m")


FORGED: dict[str, tuple[str, Any]] = {
    "n_frames": ("n_frames", 6),
    "columns": ("position_columns", 3),
    "true": ("position_columns", True),
    "no thumbnails": ("thumbnails", {"max_side": 160}),
    "thumbnails": ("thumbnails", {"max_side": 10**9, "quality": 80}),
    "digest": ("content_sha256", "0" * 63 + "G"),
    "no history": ("history", []),
    "history": ("history", [5]),
    "no segments": ("segments", []),
    "segments": ("segments", {"file": NAME}),
    "extra": ("extra", 1),
    "technique": ("technique", "hog"),
    "parameters": ("technique", {"name": "x", "version": 1, "parameters": [], "layout": {}}),
    "version": ("technique", {"name": "x", "version": "1", "parameters": {}, "layout": {}}),
    "nan": ("position_columns", float("nan")),
    "deep": ("technique", json.loads("[" * 500 + "]" * 500)),
}
FILES: dict[str, Any] = {
    "parent": "../000000-0123456789abcdef.safetensors",
    "absolute": "/etc/passwd",
    "dots": "..",
    "empty": "",
    "newline": NAME + "\n",
    "arabic digits": "٠٠٠٠٠٠" + NAME[6:],
    "nul": NAME.replace("-", "\0"),
    "none": None,
}


@pytest.mark.parametrize(("key", "value"), FORGED.values(), ids=FORGED.keys())
def test_forged_fields_are_refused_although_the_checksum_fits(key: str, value: Any) -> None:
    with pytest.raises(MapError, match=r"^m: ") as caught:
        Manifest.parse(resealed({key: value}), "m")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("key", sorted(json.loads(MANIFEST.render()).keys() - {"checksum"}))
def test_missing_fields_are_refused(key: str) -> None:
    with pytest.raises(MapError, match=r"^m: "):
        Manifest.parse(resealed({}, remove=key), "m")


@pytest.mark.parametrize("name", FILES.values(), ids=FILES.keys())
def test_file_names_that_lead_elsewhere_are_refused(name: Any) -> None:
    segment = {"file": name, "n_frames": 5, "size": 1000, "sha256": "a" * 64}
    with pytest.raises(MapError, match=r"^m: "):
        Manifest.parse(resealed({"segments": [segment]}), "m")


@pytest.mark.parametrize(
    "change", [{"n_frames": 0}, {"n_frames": 5.0}, {"size": -1}, {"size": 10**30}, {"sha256": "a"}]
)
def test_segments_with_impossible_numbers_are_refused(change: dict[str, Any]) -> None:
    segment = {"file": NAME, "n_frames": 5, "size": 1000, "sha256": "a" * 64} | change
    with pytest.raises(MapError, match=r"^m: "):
        Manifest.parse(resealed({"segments": [segment]}), "m")


def test_segment_names() -> None:
    assert is_segment_name(NAME)
    assert not is_segment_name("000000.partial")
    assert not is_segment_name("notes.txt")
