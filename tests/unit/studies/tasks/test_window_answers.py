"""Lengths answered together: each as alone, and one that fails spoils no other."""

import numpy as np
import pytest
from tests.unit.matching.streets import street

import retraverse as rt
from retraverse.errors import InputError
from retraverse.matching import describe_query
from retraverse.studies.tasks.window_answers import Answers, answer_windows


@pytest.mark.parametrize("roi", ["first", "each"])
def test_each_length_as_alone_and_a_bad_one_spoils_no_other(roi: str) -> None:
    technique = rt.technique("convsequential", resolution=96, roi=roi)
    route = rt.build_map(rt.open_traverse(street(14)), technique)
    queries = describe_query(rt.open_traverse(street(12, seed=1)), route)
    scores = rt.similarity(queries, route)
    lengths: list[rt.SequenceLength] = [2, 13, "dynamic", 5, 1]
    answers = answer_windows(queries, route, scores, lengths, lengths_by=queries)
    refusal = answers.pop(13)
    assert isinstance(refusal, InputError)
    assert "the query has only 12 frames" in str(refusal)
    assert len(answers) == 4
    for length, found in answers.items():
        assert isinstance(found, Answers)
        alone = rt.match(queries, route, sequence_length=length)
        np.testing.assert_array_equal(found.matches.reference, alone.reference)
        np.testing.assert_allclose(found.matches.score, alone.score, rtol=1e-6)
        np.testing.assert_array_equal(found.matches.sequence_length, alone.sequence_length)
        assert 0 < found.window_s < 1


def test_a_technique_without_entropy_is_refused_dynamic_lengths_only() -> None:
    route = rt.build_map(rt.open_traverse(street(14)), rt.technique("hog", resolution=64))
    queries = describe_query(rt.open_traverse(street(12)), route)
    scores = rt.similarity(queries, route)
    answers = answer_windows(queries, route, scores, ["dynamic", 3], lengths_by=queries)
    assert "hold no entropy" in str(answers["dynamic"])
    assert isinstance(answers[3], Answers)
