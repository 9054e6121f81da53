"""Checksums against the programs that publish them: git, sha1sum, sha256sum."""

import shutil
import subprocess
from pathlib import Path

import pytest

from retraverse.errors import InputError
from retraverse.weights.checksum import Seal, check_file, describe_mismatch, seal_file

# `printf 'what is up, doc?' | git hash-object --stdin` in the book "Pro Git", chapter 10.2.
DOC = b"what is up, doc?"
DOC_BLOB = "bd9dbf5aae1a3862dd1526723246b20206e5fc37"
# FIPS 180-4's example "abc".
ABC_SHA1 = "a9993e364706816aba3e25717850c26c9cd0d89d"
ABC_SHA256 = "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad"


def test_published_examples(tmp_path: Path) -> None:
    (tmp_path / "doc").write_bytes(DOC)
    (tmp_path / "abc").write_bytes(b"abc")
    assert seal_file(tmp_path / "doc").git_blob == DOC_BLOB
    seal = seal_file(tmp_path / "abc")
    assert (seal.n_bytes, seal.sha1, seal.sha256) == (3, ABC_SHA1, ABC_SHA256)


@pytest.mark.parametrize(
    ("program", "field"), [(["sha256sum"], "sha256"), (["sha1sum"], "sha1"),
                           (["git", "hash-object"], "git_blob")],
)  # fmt: skip
@pytest.mark.parametrize("n_bytes", [0, 1, (1 << 20) + 7])
def test_as_the_programs_say(tmp_path: Path, program: list[str], field: str, n_bytes: int) -> None:
    if not shutil.which(program[0]):
        pytest.skip(f"{program[0]} is not installed")
    path = tmp_path / "file"
    path.write_bytes(b"\x00\xff" * (n_bytes // 2) + b"7" * (n_bytes % 2))
    said = subprocess.run([*program, path], capture_output=True, text=True, check=True).stdout
    assert getattr(seal_file(path), field) == said.split()[0]


def test_only_what_is_known_is_compared(tmp_path: Path) -> None:
    path = tmp_path / "abc"
    path.write_bytes(b"abc")
    assert check_file(path, Seal(), "abc").sha1 == ABC_SHA1
    assert check_file(path, Seal(sha1=ABC_SHA1), "abc").n_bytes == 3
    with pytest.raises(InputError, match=r"weights abc: got bytes 3, expected 4; damaged"):
        check_file(path, Seal(n_bytes=4), "weights abc")
    assert describe_mismatch(Seal(n_bytes=3), Seal(sha256=ABC_SHA256)) is None
    assert not Seal(n_bytes=3).has_checksum
    assert Seal(git_blob=DOC_BLOB).has_checksum
