"""Sheets of right and wrong matched sequences, in pictures, where the pictures are at hand."""

from collections.abc import Sequence

import numpy as np

from retraverse.reports.study_report.artefacts import Case, Sheet
from retraverse.reports.study_report.chapters.context import ChapterInput
from retraverse.reports.study_report.picture_files import PictureFiles, Side
from retraverse.reports.study_report.words import dataset_order, dataset_title, length_words
from retraverse.studies.keeping.records import RunRecord

__all__ = ["match_sheets"]

_CASES = 3
"""Right ones, and wrong ones, of each dataset."""
_FRAMES = 4
"""Frames of a window shown at most."""


def match_sheets(
    given: ChapterInput, runs: Sequence[RunRecord], *, number: str
) -> tuple[Sheet, ...]:
    """Return one sheet for every dataset, of the most accurate of some runs; none without pictures.

    Parameters
    ----------
    given : ChapterInput
    runs : sequence of RunRecord
        One of each dataset is shown: the most accurate that answers with a sequence, if any does.
    number : str
        The thesis' number of the figures.
    """
    pictures = given.pictures
    if pictures is None:
        return ()
    chosen = []
    for dataset in sorted({run.dataset for run in runs}, key=dataset_order):
        if pictures.source(dataset) is not None:
            here = [run for run in runs if run.dataset == dataset]
            long = [run for run in here if run.mean_sequence_length > 1]
            chosen.append(max(long or here, key=lambda run: run.accuracy))
    sheets = (_sheet(run, pictures, number) for run in given.in_full(chosen))
    return tuple(sheet for sheet in sheets if sheet.cases)


def _sheet(run: RunRecord, pictures: PictureFiles, number: str) -> Sheet:
    correct = [at for at, right in enumerate(run.answer_correct) if right]
    wrong = [
        at
        for at, right in enumerate(run.answer_correct)
        if not right and run.answer_reference[at] >= 0
    ]
    cases = [_case(run, at, pictures) for at in [*_spread(correct), *_spread(wrong)]]
    shown = tuple(case for case in cases if any(query[0] for (query, _) in case.pairs))
    return Sheet(
        number,
        f"{dataset_title(run.dataset)}: right and wrong matches of {run.technique}, "
        f"{length_words(run)}",
        shown,
        "Upper row: query; lower row: map. Frames of one window at even steps."
        + ("" if wrong else " No answer of this run is wrong."),
    )


def _spread(places: Sequence[int]) -> list[int]:
    """Return up to `_CASES` of the places: from the middles of equal parts of the route."""
    if len(places) <= _CASES:
        return list(places)
    middles = (np.arange(_CASES) + 0.5) * len(places) / _CASES
    return [places[int(middle)] for middle in middles]


def _case(run: RunRecord, at: int, pictures: PictureFiles) -> Case:
    fixed = int(run.sequence_length) if run.sequence_length.isdigit() else 1
    length = run.sequence_lengths[at] if run.sequence_lengths else fixed
    query, reference = run.answer_query[at], run.answer_reference[at]
    last = min(length, run.n_queries - query, run.n_references - reference) - 1
    steps = sorted(set(np.linspace(0, max(last, 0), _FRAMES).round().astype(int).tolist()))

    def picture(side: Side, name: str, frame: int) -> tuple[str, str]:
        return pictures.address(run, side, frame), f"{name} frame {frame}"

    return Case(
        is_correct=run.answer_correct[at],
        text=f"query {query} → map {reference} · score {run.answer_score[at]:.3f} · K = {length}",
        run=run,
        pairs=tuple(
            (
                picture("query", "Query", query + step),
                picture("reference", "Map", reference + step),
            )
            for step in steps
        ),
    )
