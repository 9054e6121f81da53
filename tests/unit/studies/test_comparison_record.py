"""The one number a record derives by itself: how far an answer stands out."""

from dataclasses import replace

import numpy as np
import pytest
from tests.unit.reports.records import make_record

from retraverse.studies.comparison_record import ComparisonRecord


def slow_margin(record: ComparisonRecord, at: int, apart: int) -> float:
    """The definition, pair by pair."""
    matches = record.matches
    query, length = int(matches.query[at]), int(matches.sequence_length[at])
    means = [
        float(np.mean([record.similarity[query + t, start + t] for t in range(length)]))
        for start in range(record.similarity.shape[1] - length + 1)
    ]
    answer = int(matches.reference[at])
    if answer < 0:
        answer = int(np.argmax(means))
    rivals = [m for start, m in enumerate(means) if abs(start - answer) > max(apart, length)]
    return means[answer] - max(rivals)


@pytest.mark.parametrize("apart", [1, 10])
def test_margins_follow_their_definition(apart: int) -> None:
    record = make_record(30, 40, threshold=0.6)
    assert (record.matches.reference == -1).any()
    assert (record.matches.reference >= 0).any()
    expected = [slow_margin(record, at, apart) for at in range(len(record.matches))]
    np.testing.assert_allclose(record.margins(apart=apart), expected, atol=1e-6)


def test_a_map_without_rivals_has_no_margin() -> None:
    record = make_record(5, 5, lengths=[1] * 5)
    assert np.isnan(record.margins()).all()


def test_no_windows_no_margins() -> None:
    record = make_record(3, 40, lengths=[9] * 3, tolerance=None)
    assert record.margins().shape == (0,)


def test_a_record_cannot_be_changed() -> None:
    record = make_record(5, 5)
    with pytest.raises(AttributeError):
        record.notes = ()  # type: ignore[misc]
    assert replace(record, notes=("a",)).notes == ("a",)
