"""One file out of an archive: the right one, nowhere else, and not without end."""

import io
import random
import tarfile
import zipfile
from pathlib import Path

import pytest

from retraverse.errors import InputError
from retraverse.weights.archive import extract_member, is_archive


def zip_of(path: Path, files: dict[str, bytes]) -> Path:
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in files.items():
            archive.writestr(name, content)
    return path


def tar_of(path: Path, files: dict[str, bytes], mode: str = "w:gz") -> Path:
    with tarfile.open(path, mode) as archive:  # type: ignore[call-overload]
        for name, content in files.items():
            info = tarfile.TarInfo(name)
            info.size = len(content)
            archive.addfile(info, io.BytesIO(content))
    return path


FILES = {"readme.txt": b"hello", "model/calc.caffemodel": b"weights", "model/deploy.prototxt": b"g"}


@pytest.mark.parametrize("pattern", ["model/calc.caffemodel", "*calc.caffemodel", "*.caffemodel"])
def test_the_file_asked_for(tmp_path: Path, pattern: str) -> None:
    archives = [
        zip_of(tmp_path / "a.zip", FILES),
        tar_of(tmp_path / "a.tar.gz", FILES),
        tar_of(tmp_path / "a.tar.xz", FILES, "w:xz"),
    ]
    for archive in archives:
        assert is_archive(archive)
        target = tmp_path / "out"
        extract_member(archive, pattern, target)
        assert target.read_bytes() == b"weights"
        target.unlink()


@pytest.mark.parametrize("make", [zip_of, tar_of])
def test_names_that_lead_elsewhere_lead_nowhere(tmp_path: Path, make: object) -> None:
    inner = tmp_path / "inner"
    inner.mkdir()
    files = {"../../evil.caffemodel": b"weights"}
    archive = make(inner / "a.bin", files)  # type: ignore[operator]
    extract_member(archive, "*.caffemodel", inner / "target")
    assert (inner / "target").read_bytes() == b"weights"
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["a.bin", "inner", "target"]


@pytest.mark.parametrize("kind", [tarfile.SYMTYPE, tarfile.LNKTYPE, tarfile.FIFOTYPE])
def test_links_and_pipes_are_no_files(tmp_path: Path, kind: bytes) -> None:
    with tarfile.open(tmp_path / "a.tar", "w") as archive:
        info = tarfile.TarInfo("x.caffemodel")
        info.type, info.linkname = kind, "/etc/passwd"
        archive.addfile(info)
    with pytest.raises(InputError, match="0 files fit"):
        extract_member(tmp_path / "a.tar", "*.caffemodel", tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_one_and_only_one(tmp_path: Path) -> None:
    archive = zip_of(tmp_path / "a.zip", {"a.caffemodel": b"1", "b.caffemodel": b"2"})
    with pytest.raises(InputError, match=r"2 files fit.*a.caffemodel, b.caffemodel"):
        extract_member(archive, "*.caffemodel", tmp_path / "out")
    with pytest.raises(InputError, match=r"0 files fit '\*.mat'"):
        extract_member(archive, "*.mat", tmp_path / "out")


def test_small_archive_does_not_fill_the_disk(tmp_path: Path) -> None:
    archive = zip_of(tmp_path / "bomb.zip", {"a.caffemodel": bytes(8 << 20)})
    assert archive.stat().st_size < 20_000
    with pytest.raises(InputError, match="more than 1048576 bytes"):
        extract_member(archive, "*.caffemodel", tmp_path / "out", largest=1 << 20)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["bomb.zip"]


@pytest.mark.parametrize("make", [zip_of, tar_of])
@pytest.mark.parametrize("seed", [1073707045, random.randrange(2**32)], ids=["found", "new"])
def test_damage_is_one_line(tmp_path: Path, make: object, seed: int) -> None:

    files = {"a.caffemodel": random.Random(2).randbytes(20_000), "b": b"2"}
    whole = make(tmp_path / "a.bin", files).read_bytes()  # type: ignore[operator]
    print(f"seed {seed}")
    choose = random.Random(seed)
    for _ in range(60):
        broken = bytearray(
            whole[: choose.randrange(len(whole))] if choose.random() < 0.5 else whole
        )
        for _ in range(3):
            if broken:
                broken[choose.randrange(len(broken))] = choose.randrange(256)
        (tmp_path / "broken").write_bytes(broken)
        said = ""
        try:
            extract_member(tmp_path / "broken", "*.caffemodel", tmp_path / "out")
        except InputError as error:
            said = str(error)
        assert "\n" not in said
    assert not list(tmp_path.glob(".*"))
