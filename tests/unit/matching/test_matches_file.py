"""Matches survive the way through a CSV file; a file that is none is refused with its line."""

import dataclasses
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from retraverse.errors import DataMissingError, InputError
from retraverse.matching import Matches, load_matches, save_matches

HEAD = "query,query_name,reference,reference_name,score,sequence_length,n_references\n"


def save(matches: Matches, path: Path) -> None:
    save_matches(
        matches,
        path,
        query_names=[f"q,{i}.jpg" for i in range(matches.n_queries)],
        reference_names=[f'r"{i}.jpg' for i in range(matches.n_references)],
    )


@given(
    seed=st.integers(0, 2**32 - 1),
    n_queries=st.integers(1, 30),
    n_references=st.integers(1, 40),
    tail=st.integers(0, 5),
)
def test_round_trip(
    tmp_path_factory: pytest.TempPathFactory,
    seed: int,
    n_queries: int,
    n_references: int,
    tail: int,
) -> None:
    random = np.random.default_rng(seed)
    n_windows = max(0, n_queries - tail)
    matches = Matches(
        query=np.arange(n_windows),
        reference=random.integers(-1, n_references, n_windows),
        score=random.normal(size=n_windows).astype(np.float32),
        sequence_length=random.integers(1, 25, n_windows),
        n_queries=n_queries,
        n_references=n_references,
    )
    path = tmp_path_factory.mktemp("csv") / "matches.csv"
    save(matches, path)
    loaded = load_matches(path)
    for name in ("query", "reference", "score", "sequence_length"):
        np.testing.assert_array_equal(getattr(loaded, name), getattr(matches, name))
    assert (loaded.n_queries, loaded.n_references) == (n_queries, n_references)


def test_where_each_frame_belongs_is_kept(tmp_path: Path) -> None:
    matches = Matches(
        query=np.array([1, 2]),
        reference=np.array([4, 5]),
        score=np.array([1, 2], np.float32),
        sequence_length=np.array([3, 3]),
        n_queries=4,
        n_references=9,
        followed=np.array([3, 4, 5, 7]),
    )
    save(matches, tmp_path / "matches.csv")
    assert load_matches(tmp_path / "matches.csv").frame_reference.tolist() == [3, 4, 5, 7]
    diagonals = dataclasses.replace(matches, followed=None)
    save(diagonals, tmp_path / "matches.csv")
    assert load_matches(tmp_path / "matches.csv").followed is None


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no rows"),
        (HEAD, "no rows"),
        ("query,reference\n0,0\n", "n_references, score, sequence_length is missing"),
        (HEAD + "0,a,x,b,0.5,1,9\n", "line 2: reference is 'x'"),
        (HEAD + "0,a,1,b,0.5,1,9\n1,a,1,b,high,1,9\n", "line 3: score is 'high'"),
        (HEAD + "0,a,1,b,0.5,1,9\n1,a,1,b,0.5,1,8\n", "n_references differs"),
        (HEAD + "0,a,1\n", "line 2"),
    ],
)
def test_refuses_what_is_no_table_of_matches(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "matches.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=said):
        load_matches(path)


def test_missing_and_binary_files(tmp_path: Path) -> None:
    with pytest.raises(DataMissingError, match="no such file"):
        load_matches(tmp_path / "none.csv")
    (tmp_path / "picture.csv").write_bytes(b"\xff\xd8\xff\xe0" * 50)
    with pytest.raises(InputError, match="not a CSV text"):
        load_matches(tmp_path / "picture.csv")
