"""What is known of the published ground truths, checked on the real files."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from retraverse.datasets import GroundTruth, aligned, ground_truth

Shared = Callable[[str], Path]

FOLDER = "data/vprbench/ground_truth"


def lists(truth: GroundTruth) -> list[list[int]]:
    return [listed.tolist() for listed in truth.positives]


def test_every_published_file_is_read(shared: Shared) -> None:
    paths = sorted(shared(FOLDER).glob("*.json"))
    assert len(paths) == 14
    assert all(ground_truth(path).n_queries >= 10 for path in paths)


@pytest.mark.parametrize(
    ("name", "n_frames", "tolerance"),
    [("corridor", 111, 2), ("ESSEX3IN1_dataset", 210, 0), ("SPEDTEST", 607, 0), ("Living", 32, 1)],
)
def test_sets_that_are_index_aligned(
    shared: Shared, name: str, n_frames: int, tolerance: int
) -> None:
    truth = ground_truth(shared(f"{FOLDER}/{name}.json"), n_references=n_frames)
    assert truth.n_dropped == 0
    assert lists(truth) == lists(aligned(n_frames, n_frames, tolerance))


@pytest.mark.parametrize(("name", "n_frames"), [("GardensPointWalking", 200), ("17places", 406)])
def test_sets_whose_last_rows_list_two_references_that_do_not_exist(
    shared: Shared, name: str, n_frames: int
) -> None:
    truth = ground_truth(shared(f"{FOLDER}/{name}.json"), n_references=n_frames)
    assert lists(truth) == lists(aligned(n_frames, n_frames, 2))
    assert truth.n_dropped == 3, "one by the last row but one, two by the last"
    assert "3 positives past" in truth.description


def test_a_set_with_queries_that_have_no_match(shared: Shared) -> None:
    truth = ground_truth(shared(f"{FOLDER}/GardensPoint_TN.json"))
    without = np.flatnonzero(~truth.has_match())
    assert len(without) > 0
    assert truth.is_correct(without, np.full(len(without), -1)).all()


def test_nordland_query_i_is_reference_10_i(shared: Shared) -> None:
    truth = ground_truth(shared(f"{FOLDER}/Nordland.json"), n_references=27592)
    query = np.arange(1, 2759)
    for offset, expected in ((-2, False), (-1, True), (0, True), (1, True), (2, False)):
        assert (truth.is_correct(query, 10 * query + offset) == expected).all()
