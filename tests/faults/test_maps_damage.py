"""A truncated, edited or foreign file is refused with one line; nothing wrong is ever accepted."""

import json
import os
import random
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from tests.unit.maps.fakes import FakeTechnique, fake_registered, frames, snapshot

from retraverse.errors import MapError
from retraverse.maps import build_map, load_map
from retraverse.maps import segment as segment_room
from retraverse.maps.manifest import Manifest


@pytest.fixture(autouse=True)
def _small(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    monkeypatch.setattr(segment_room, "SEGMENT_BYTES", 4 * 900)
    with fake_registered():
        yield


@pytest.fixture
def place(tmp_path: Path) -> Path:
    """Return a map of three segments, with thumbnails and positions."""
    build_map(
        frames(11),
        FakeTechnique(),
        path=tmp_path / "route.map",
        thumbnails=16,
        positions=[(row, row / 2) for row in range(11)],
    )
    return tmp_path / "route.map"


def files_of(place: Path) -> list[Path]:
    files = [place / "manifest.json", *sorted((place / "segments").iterdir())]
    assert len(files) == 4
    return files


def refusal(place: Path, *, verify: bool = True) -> str:
    """Return the line a map is refused with."""
    with pytest.raises(MapError) as caught:
        load_map(place, verify=verify)
    line = str(caught.value)
    assert "\n" not in line
    assert str(place) in line
    return line


def test_every_file_is_needed(place: Path) -> None:
    for file in files_of(place):
        hidden = file.rename(file.with_suffix(".hidden"))
        is_manifest = file.name == "manifest.json"
        said = "it has no manifest.json" if is_manifest else f"{file}: cannot be opened"
        assert said in refusal(place)
        hidden.rename(file)
    load_map(place)


@pytest.mark.heavy
def test_truncated_files(place: Path, scaled: Callable[[int], int]) -> None:
    generator = seeded()
    for file in files_of(place):
        content = file.read_bytes()
        lengths = {0, 1, 7, 8, len(content) - 1} | {
            generator.randrange(len(content)) for _ in range(scaled(100))
        }
        for length in lengths:
            file.write_bytes(content[:length])
            assert str(file) in refusal(place)
            refusal(place, verify=False)
        file.write_bytes(content)
    load_map(place)


@pytest.mark.heavy
def test_changed_bytes(place: Path, scaled: Callable[[int], int]) -> None:
    generator = seeded()
    for file in files_of(place):
        content = file.read_bytes()
        for _ in range(scaled(500)):
            changed = bytearray(content)
            where = generator.randrange(len(content))
            changed[where] ^= generator.randrange(1, 256)
            file.write_bytes(changed)
            assert str(file) in refusal(place)
        file.write_bytes(content)
    load_map(place)


@pytest.mark.heavy
def test_blocks_lost_moved_or_swapped(place: Path, scaled: Callable[[int], int]) -> None:
    """What file systems do after a crash: runs of zeros, of other files, in other places."""
    generator = seeded()
    files = files_of(place)
    contents = {file: file.read_bytes() for file in files}
    for _ in range(scaled(300)):
        file = generator.choice(files)
        changed = bytearray(contents[file])
        start = generator.randrange(len(changed))
        length = generator.randrange(1, 400)
        other = contents[generator.choice(files)]
        offset = generator.randrange(len(other))
        changed[start : start + length] = generator.choice(
            [b"", bytes(length), other[offset : offset + length], b"\xff" * length]
        )
        if bytes(changed) == contents[file]:
            continue
        file.write_bytes(changed)
        refusal(place)
        file.write_bytes(contents[file])
    load_map(place)


def test_segments_in_each_others_place(place: Path) -> None:
    _, first, second, _ = files_of(place)
    middle = first.with_suffix(".middle")
    first.rename(middle)
    second.rename(first)
    middle.rename(second)
    assert "checksum" in refusal(place) or "bytes" in refusal(place)


@pytest.mark.heavy
def test_without_checksums_damage_to_the_form_is_still_found(
    place: Path, scaled: Callable[[int], int]
) -> None:
    """A map is then refused or loads as a whole; no other error, no crash."""
    generator = seeded()
    segment = files_of(place)[1]
    content = segment.read_bytes()
    header_end = 8 + int.from_bytes(content[:8], "little")
    refused = 0
    for _ in range(scaled(1000)):
        changed = bytearray(content)
        where = generator.randrange(header_end)
        changed[where] ^= generator.randrange(1, 256)
        segment.write_bytes(changed)
        try:
            route = load_map(place, verify=False)
        except MapError:
            refused += 1
        else:
            assert snapshot(route)["frames"]
    assert refused


def seeded() -> random.Random:
    seed = random.randrange(1 << 32)
    print(f"seed {seed}")
    return random.Random(seed)


def test_foreign_folders(tmp_path: Path) -> None:
    assert "not a route map" in refusal(tmp_path)
    (tmp_path / "manifest.json").write_text('{"format": "zarr", "version": 3}')
    assert "not the manifest of a retraverse map" in refusal(tmp_path)
    (tmp_path / "manifest.json").write_bytes(b"\x80\x04\x95")  # how pickles begin
    assert "not the manifest of a retraverse map" in refusal(tmp_path)
    (tmp_path / "picture.jpg").write_bytes(b"\xff\xd8")
    assert "a map is a folder, got a file" in refusal(tmp_path / "picture.jpg")


def reseal(place: Path, change: Callable[[dict[str, Any]], None]) -> None:
    """Change the manifest and give it the checksum that fits: a forger, not an accident."""
    import hashlib

    manifest = place / "manifest.json"
    record = json.loads(manifest.read_bytes())
    record.pop("checksum")
    change(record)
    body = (json.dumps(record, indent=1) + "\n").encode()
    record["checksum"] = hashlib.sha256(body).hexdigest()
    manifest.write_bytes((json.dumps(record, indent=1) + "\n").encode())


def test_resealing_alone_changes_nothing(place: Path) -> None:
    before = (place / "manifest.json").read_bytes()
    reseal(place, lambda record: None)
    assert (place / "manifest.json").read_bytes() == before


def test_a_newer_format(place: Path) -> None:
    reseal(place, lambda record: record.update(format_version=2))
    assert "map format 2, this program reads format 1" in refusal(place)


def test_another_technique(place: Path) -> None:
    def change(what: str, value: Any) -> str:
        before = (place / "manifest.json").read_bytes()
        reseal(place, lambda record: record["technique"].update({what: value}))
        line = refusal(place)
        (place / "manifest.json").write_bytes(before)
        return line

    assert "made with fake(size=8, gain=1.0) version 2, this program has" in change("version", 2)
    assert "this program lacks: unknown technique: got 'nonesuch'" in change("name", "nonesuch")
    assert "unknown parameter of fake: got 'depth'" in change("parameters", {"depth": 3})
    assert "expected int" in change("parameters", {"size": [8]})
    # Fewer parameters than there are: others would silently take their defaults.
    assert "made with fake(size=8) version 3, this program has" in change("parameters", {"size": 8})
    assert "but its arrays are" in change("layout", {"kind": "global", "arrays": {}})


@pytest.mark.parametrize("name", ["../../secret", "/etc/passwd", "../segments/{}", "./{}", "{}/"])
def test_paths_that_lead_elsewhere(place: Path, name: str) -> None:
    def change(record: dict[str, Any]) -> None:
        record["segments"][0]["file"] = name.format(record["segments"][0]["file"])

    reseal(place, change)
    assert "is no segment's file name" in refusal(place)


def test_links_are_not_followed(place: Path, tmp_path: Path) -> None:
    for file in files_of(place):
        elsewhere = file.rename(tmp_path / "elsewhere")
        file.symlink_to(elsewhere)
        assert f"{file}: cannot be opened" in refusal(place)
        elsewhere.replace(file)
    (place / "segments").rename(tmp_path / "segments")
    (place / "segments").symlink_to(tmp_path / "segments")
    assert f"{place / 'segments'}: not a folder that can be opened" in refusal(place)
    with pytest.raises(MapError, match="not a folder that can be opened"):
        build_map(frames(2), FakeTechnique(), path=place, overwrite=True)
    assert len(list((tmp_path / "segments").iterdir())) == 3, "nothing outside is swept away"


def test_what_is_no_plain_file(place: Path) -> None:
    for file in files_of(place):
        content = file.read_bytes()
        file.unlink()
        os.mkfifo(file)
        assert "not a plain file" in refusal(place)
        file.unlink()
        file.mkdir()
        assert "not a plain file" in refusal(place)
        file.rmdir()
        file.write_bytes(content)


def test_a_file_that_may_not_be_read(place: Path) -> None:
    if os.geteuid() == 0:
        pytest.skip("root may read everything")
    (place / "manifest.json").chmod(0)
    assert "Permission denied" in refusal(place)


@pytest.mark.heavy
def test_forged_manifests_never_crash(place: Path, scaled: Callable[[int], int]) -> None:
    """Any value anywhere, with a fitting checksum: refused, or loaded as a whole."""
    generator = seeded()
    before = snapshot(load_map(place))
    original = (place / "manifest.json").read_bytes()
    numbers = [None, True, 0, -1, 1, 2, 1 << 62, 10**400, 1.5]
    values = [*numbers, "", "x", "../x", "a\nb", "a" * 64, [], {}, [1], {"a": 1}, {"a\nb": 1}]
    refused = 0
    for _ in range(scaled(1000)):
        reseal(place, lambda record: _set_anywhere(record, generator, generator.choice(values)))
        try:
            route = load_map(place)
        except MapError:
            refusal(place)
            refused += 1
        else:
            # Nobody can tell that a parameter, a date or the content's hash was forged.
            untold = {"content": None, "technique": None}
            assert snapshot(route) | untold == before | untold
        (place / "manifest.json").write_bytes(original)
    assert refused


def _set_anywhere(record: Any, generator: random.Random, value: Any) -> None:
    """Put `value` in the place of one entry, at any depth."""
    while True:
        keys = list(record) if isinstance(record, dict) else list(range(len(record)))
        key = generator.choice(keys)
        inner = record[key]
        if not isinstance(inner, (dict, list)) or not inner or generator.random() < 0.3:
            record[key] = value
            return
        record = inner


def test_a_damaged_map_is_not_extended(place: Path) -> None:
    segment = files_of(place)[-1]
    route = load_map(place)
    shutil.copy(segment, segment.with_suffix(".backup"))
    segment.write_bytes(segment.read_bytes()[:-1])
    with pytest.raises(MapError, match="truncated"):
        load_map(place).extend(frames(1), positions=[(0, 0)])
    assert Manifest.parse((place / "manifest.json").read_bytes(), "m").n_frames == len(route)
