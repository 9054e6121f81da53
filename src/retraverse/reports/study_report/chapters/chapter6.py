"""Chapter 6: compressed pictures in sequences, by the bytes and the time of one answer."""

import math
from collections.abc import Sequence

from retraverse.reports.study_report.artefacts import Artefact, Cell, Chapter, Section, Table
from retraverse.reports.study_report.chapters.bare_sizes import bare_table
from retraverse.reports.study_report.chapters.chapter4 import encoding_table
from retraverse.reports.study_report.chapters.context import ChapterInput, long_table
from retraverse.reports.study_report.chapters.data_of_answers import (
    data_figure,
    first_full,
    smallest_data_table,
)
from retraverse.reports.study_report.chapters.least_data import (
    Pick,
    least_data_picks,
    mixed_figures,
    total_table,
)
from retraverse.reports.study_report.chapters.saved import savings_table
from retraverse.reports.study_report.figures import first_run, over_compression
from retraverse.reports.study_report.pictures_only import picture_runs
from retraverse.reports.study_report.series import Runs
from retraverse.reports.study_report.words import compression_text, meanings, size_text
from retraverse.reports.wording import NOTHING
from retraverse.studies.judging.selection import data_per_answer, mean_bytes
from retraverse.studies.keeping.records import RunRecord

__all__ = ["chapter_6"]


def chapter_6(given: ChapterInput) -> Chapter:
    """Return the page of chapter 6."""
    runs = _by_default_encoder(given)
    pictures = Runs(picture_runs(given.records), given.book)
    picks = least_data_picks(runs)
    return Chapter(
        "6",
        "Compressed pictures in sequences",
        "Compression loses places and longer sequences win them back: which mix of the two sends "
        "the fewest bytes, and what time does it take?",
        (
            Section("How small do pictures become?", _sizes(given, runs, pictures)),
            Section("How long must sequences be, and what do they weigh?", _lengths(given, runs)),
            Section(
                "What does compression save at equal accuracy?",
                (savings_table(given, runs),),
            ),
            Section(
                "Query and map compressed differently",
                mixed_figures(picks),
                "For every technique and dataset at the c whose answers take the fewest bytes.",
            ),
            Section("What time does it take?", _times(given, runs, pictures, picks)),
        ),
        given.records,
    )


def _by_default_encoder(given: ChapterInput) -> Runs:
    """Return the runs of the chapter's encoder, the optimising one where it was used.

    Sizes, and the table of smallest K, show the plain one beside it.
    """
    optimised = [run for run in given.records if "optimize" in run.encoder or not run.encoder]
    has_any = any(run.encoder for run in optimised)
    return Runs(optimised if has_any else given.records, given.book)


def _sizes(given: ChapterInput, runs: Runs, pictures: Runs) -> tuple[Artefact, ...]:
    return (
        over_compression(
            pictures,
            lambda run: mean_bytes(run) / 1000,
            number="Figure 6.1",
            title="Mean size of a picture",
            y_label="Size, kB",
            definitions=meanings("picture size", "c"),
            is_log=True,
        ),
        _descriptor_table(given, runs),
        bare_table(given.records),
    )


def _descriptor_table(given: ChapterInput, runs: Runs) -> Table:
    steps = sorted({place.compression_query for place in runs.places if place.is_uniform})
    rows = []
    for dataset in runs.datasets:
        for series in runs.series:
            by_step = {
                place.compression_query: run
                for place in runs.places_of(series, dataset)
                if place.is_uniform
                and (run := first_run(runs.at(series, dataset, place))) is not None
            }
            run = next((run for run in by_step.values() if run.descriptor_bytes > 0), None)
            if run is not None:
                size = given.published("6.1", run, "size")
                cells = (_ratio_cell(given, by_step.get(step), step) for step in steps)
                first = Cell(
                    size_text(run.descriptor_bytes),
                    float(run.descriptor_bytes),
                    published=f"{size} KB" if size else "",
                )
                rows.append((series, run, (first, *cells)))
    return long_table(
        given,
        rows,
        number="Table 6.1",
        title="A picture's size over its descriptor's",
        head=("Descriptor", *(f"c = {compression_text(step)}" for step in steps)),
        caption="Below 100 %, sending the picture is cheaper than sending its descriptor.",
        definitions=meanings("picture size", "descriptor size"),
    )


def _ratio_cell(given: ChapterInput, run: RunRecord | None, step: int) -> Cell:
    if run is None or not run.descriptor_bytes > 0:
        return Cell(NOTHING, math.nan)
    share = mean_bytes(run) / run.descriptor_bytes
    thesis = given.published("6.1", run, str(max(step, 0)))
    return Cell(_percents(100 * share), share, run, f"{thesis} %" if thesis else "")


def _percents(value: float) -> str:
    return f"{value:,.0f} %" if value >= 100 else f"{value:.3g} %"


def _lengths(given: ChapterInput, runs: Runs) -> tuple[Artefact, ...]:
    return (
        over_compression(
            runs,
            lambda run: float(run.sequence_length),
            number="Figure 6.2",
            title="Smallest K with 100 % accuracy",
            y_label="K, frames",
            pick=first_full,
            caption="No point: no K of the study reaches 100 %.",
            definitions=meanings("smallest K", "c"),
        ),
        over_compression(
            runs,
            lambda run: data_per_answer(run) / 1000,
            number="Figure 6.3",
            title="Data of one answer at that K",
            y_label="d, kB",
            pick=first_full,
            caption="The lowest point of a line is the mix to choose, if bytes are what counts.",
            definitions=meanings("d", "smallest K", "c"),
            is_log=True,
        ),
        smallest_data_table(given, given.over_length),
        data_figure(runs),
    )


def _times(
    given: ChapterInput, runs: Runs, pictures: Runs, picks: Sequence[Pick]
) -> tuple[Artefact, ...]:
    return (
        over_compression(
            runs,
            lambda run: 1000 * run.vpr_s,
            number="Figure 6.5",
            title="t_VPR at the smallest K with 100 %",
            y_label="t_VPR, ms",
            pick=first_full,
            definitions=meanings("t_VPR", "smallest K", "c"),
            is_log=True,
        ),
        over_compression(
            pictures,
            lambda run: 1000 * run.compress_s,
            number="Figure 6.7",
            title="Time to compress one picture",
            y_label="t_c, ms",
            definitions=meanings("t_c", "c"),
        ),
        encoding_table(given, runs, number="6.2"),
        *(total_table(given, runs, dataset, picks) for dataset in runs.datasets),
    )
