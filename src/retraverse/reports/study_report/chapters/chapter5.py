"""Chapter 5: JPEG compression and what it does to single frames."""

import math
from collections.abc import Callable, Iterable

from retraverse.reports.study_report.artefacts import (
    Artefact,
    Cell,
    Chapter,
    Figure,
    Row,
    Section,
    Table,
)
from retraverse.reports.study_report.chapters.context import ChapterInput
from retraverse.reports.study_report.figures import (
    PERCENT,
    accuracy_percent,
    over_compression,
    weighted_means,
)
from retraverse.reports.study_report.pictures_only import picture_runs
from retraverse.reports.study_report.series import Place, Runs, is_whole, place_of
from retraverse.reports.study_report.words import (
    compression_text,
    dataset_order,
    dataset_title,
    meanings,
    size_text,
)
from retraverse.studies.judging.selection import mean_bytes
from retraverse.studies.keeping.records import RunRecord

__all__ = ["chapter_5", "dataset_sizes", "non_uniform_figures"]


def chapter_5(given: ChapterInput) -> Chapter:
    """Return the page of chapter 5."""
    runs = given.single_frames
    by_dataset = over_compression(
        runs,
        accuracy_percent,
        number="Figure 5.3",
        title="Accuracy over compression",
        y_label="Accuracy, %",
        caption="Query and map compressed alike. Shaded: 95 % intervals.",
        definitions=meanings("accuracy", "interval", "c"),
        y_limits=PERCENT,
        with_interval=True,
    )
    mean = weighted_means(
        by_dataset,
        number="Figures 5.5, 5.6",
        title="Accuracy over compression, mean of the datasets",
        caption="Which technique bears compression best, on the whole.",
        weigh=False,
    )
    return Chapter(
        "5",
        "JPEG compression and single frames",
        "How far can pictures be compressed before places are lost, and which technique bears it?",
        (
            Section(
                "How small do pictures become?",
                (
                    dataset_sizes(given, number="5.1", over="compression"),
                    over_compression(
                        Runs(picture_runs(given.records), given.book),
                        lambda run: run.entropy_query_mean,
                        number="Figure 5.4",
                        title="Entropy of the query pictures",
                        y_label="Mean entropy",
                        caption="Compression takes texture away, and entropy with it.",
                        definitions=meanings("entropy", "c"),
                    ),
                ),
            ),
            Section(
                "How much accuracy is lost?", (by_dataset, *_if_drawn(mean), *_sequences(given))
            ),
            Section(
                "Query and map compressed differently",
                tuple(non_uniform_figures(runs, ("Figure 5.7", "Figure 5.8"))),
                "A robot sends compressed pictures to a clean map, or the other way round.",
            ),
        ),
        given.records,
    )


def _sequences(given: ChapterInput) -> tuple[Figure, ...]:
    """Return the same with sequences, which the thesis does not have."""
    if given.sequences is None:
        return ()
    length, runs = given.sequences
    return (
        over_compression(
            runs,
            accuracy_percent,
            number="",
            title=f"Accuracy over compression with sequences of K = {length}",
            y_label="Accuracy, %",
            caption="Added here: what a few frames more win back.",
            definitions=meanings("accuracy", "interval", "c", "K"),
            y_limits=PERCENT,
            with_interval=True,
        ),
    )


def _if_drawn(figure: Figure) -> tuple[Figure, ...]:
    return (figure,) if figure.panels else ()


def dataset_sizes(given: ChapterInput, *, number: str, over: str) -> Table:
    """Return the bytes of each dataset at each c (5.1) or size (7.1)."""
    at = _compression if over == "compression" else _size
    found: dict[str, dict[int, RunRecord]] = {}
    for run in given.records:
        step = at(run)
        if run.status == "ok" and step is not None and run.query_bytes_total >= 0:
            sizes = found.setdefault(run.dataset, {})
            # At one size the pictures compressed least stand for it.
            if step not in sizes or run.compression_query < sizes[step].compression_query:
                sizes[step] = run
    steps = sorted({step for sizes in found.values() for step in sizes}, key=lambda s: (s == 0, s))
    if over == "compression":
        steps = sorted(steps)
    rows = tuple(
        Row(
            (
                Cell(dataset_title(dataset), run=next(iter(sizes.values()))),
                *(_size_cell(given, number, dataset, step, sizes) for step in steps),
            )
        )
        for dataset, sizes in sorted(found.items(), key=lambda item: dataset_order(item[0]))
    )
    names = compression_text if over == "compression" else _size_name
    return Table(
        f"Table {number}",
        "Size of each dataset",
        ("Dataset", *(("c = " if over == "compression" else "") + names(step) for step in steps)),
        rows + given.absent_rows(1, dataset_column=0),
        "Query and map together; in brackets, one picture.",
        meanings("dataset size", "picture size"),
        is_published=True,
    )


def _compression(run: RunRecord) -> int | None:
    return run.compression_query if _is_compressed_alike(run) else None


def _size(run: RunRecord) -> int | None:
    return run.resize if _is_compressed_alike(run) else None


def _is_compressed_alike(run: RunRecord) -> bool:
    return is_whole(run) and place_of(run).is_uniform


def _size_name(size: int) -> str:
    return f"{size} px" if size else "as is"


def _size_cell(
    given: ChapterInput, number: str, dataset: str, step: int, sizes: dict[int, RunRecord]
) -> Cell:
    run = sizes.get(step)
    if run is None:
        return Cell("–", math.nan)
    total = run.query_bytes_total + run.reference_bytes_total
    # The thesis' c = 0 are the pictures as they came.
    column = str(max(step, 0))
    thesis = given.published(number, run, column, row=dataset)
    return Cell(
        size_text(total),
        float(total),
        None,
        f"{thesis} MB" if thesis else "",
        f"({size_text(mean_bytes(run))})",
    )


def non_uniform_figures(runs: Runs, numbers: tuple[str, str]) -> Iterable[Artefact]:
    """Return accuracy with only the query, and only the map, compressed ever more."""
    sides: tuple[tuple[str, str, Callable[[Place], int], Callable[[Place], int]], ...] = (
        ("query", "map", lambda p: p.compression_query, lambda p: p.compression_reference),
        ("map", "query", lambda p: p.compression_reference, lambda p: p.compression_query),
    )
    for number, (varied, fixed, of_varied, of_fixed) in zip(numbers, sides, strict=True):
        mixed = [place for place in runs.places if place.is_mixed]
        if not mixed:
            continue
        base = min(of_fixed(place) for place in mixed)
        figure = over_compression(
            runs,
            accuracy_percent,
            number=number,
            title=f"Only the {varied} pictures compressed",
            y_label="Accuracy, %",
            where=_at_base(of_fixed, base),
            compression=of_varied,
            x_label=f"JPEG compression of the {varied}, %",
            caption=f"The {fixed} pictures stay at c = {compression_text(base)}.",
            definitions=meanings("accuracy", "c"),
            y_limits=PERCENT,
        )
        if figure.panels:
            yield figure


def _at_base(side: Callable[[Place], int], base: int) -> Callable[[Place], bool]:
    return lambda place: side(place) == base
