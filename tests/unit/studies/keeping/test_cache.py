"""The cache: arrays come back as they were, other programs can read them, keys tell apart."""

from pathlib import Path

import numpy as np
import pytest
from safetensors.numpy import load_file

from retraverse.errors import DataMissingError, InputError
from retraverse.studies.keeping.cache import CacheEntry, StudyCache, content_key, load_matrix
from retraverse.types import Array

KEY = content_key("a key")
ARRAYS: dict[str, Array] = {
    "descriptor": np.arange(12, dtype=np.float32).reshape(3, 4),
    "bits": np.arange(5, dtype=np.uint8),
    "none": np.zeros((0, 3), np.float64),
    "seconds": np.array(1.5),
    "flags": np.array([True, False]),
    "counts": np.array([-1, 2**40]),
}


@pytest.fixture
def cache(tmp_path: Path) -> StudyCache:
    return StudyCache(tmp_path / "cache")


def same(got: dict[str, Array] | None) -> bool:
    return got is not None and all(
        np.array_equal(got[name], array) and got[name].dtype == array.dtype
        for name, array in ARRAYS.items()
    )


def test_round_trip(cache: StudyCache) -> None:
    assert cache.load(KEY) is None
    assert not cache.has(KEY)
    cache.save(KEY, ARRAYS)
    assert same(cache.load(KEY))
    assert same(StudyCache(cache.folder).load(KEY)), "another process compares the checksum"
    assert same(cache.entry(KEY).load())
    assert cache.has(KEY)


def test_the_safetensors_package_reads_it(cache: StudyCache) -> None:
    cache.save(KEY, ARRAYS)
    assert same(load_file(cache.entry(KEY).path))


def test_every_flipped_byte_is_found(cache: StudyCache) -> None:
    cache.save(KEY, ARRAYS)
    path = cache.entry(KEY).path
    whole = path.read_bytes()
    for place in range(len(whole)):
        path.write_bytes(whole[:place] + bytes([whole[place] ^ 1]) + whole[place + 1 :])
        try:
            got = CacheEntry(path).load()
        except InputError:
            continue
        # Spaces that fill up the header mean nothing.
        assert same(got), f"byte {place}"


@pytest.mark.parametrize("length", [0, 1, 7, 8, 100, 300])
def test_cut_short(cache: StudyCache, length: int) -> None:
    cache.save(KEY, ARRAYS)
    path = cache.entry(KEY).path
    path.write_bytes(path.read_bytes()[:length])
    fresh = StudyCache(cache.folder)
    assert fresh.load(KEY) is None
    assert fresh.damaged == [KEY]
    assert not path.exists()


def test_an_entry_that_is_gone(tmp_path: Path) -> None:
    with pytest.raises(DataMissingError, match="not there"):
        CacheEntry(tmp_path / "none").load()


def test_a_folder_that_is_not_ours(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="cannot be written"):
        StudyCache(tmp_path / "file").save(KEY, ARRAYS)


def test_matrices_for_reports(cache: StudyCache) -> None:
    cache.save(KEY, {"similarity": np.eye(3, dtype=np.float32)})
    assert np.array_equal(load_matrix(cache.folder, KEY), np.eye(3))  # type: ignore[arg-type]
    assert load_matrix(cache.folder, "") is None
    assert load_matrix(cache.folder, content_key("other")) is None


def test_keys() -> None:
    assert content_key({"a": 1, "b": b"2"}) == content_key({"b": b"2", "a": np.int64(1)})
    distinct = [("a", "b"), ("ab",), (["a", "b"],), ("a", None), (1,), ("1",), (1.0,), (True,)]
    assert len({content_key(*parts) for parts in distinct}) == len(distinct)
    with pytest.raises(TypeError, match="has no place in a content key"):
        content_key(object())
