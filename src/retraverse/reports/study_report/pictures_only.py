"""Lines about the pictures alone: the same whichever technique looks at them."""

from collections.abc import Iterable
from dataclasses import replace

from retraverse.studies.keeping.records import RunRecord

__all__ = ["picture_runs"]


def picture_runs(records: Iterable[RunRecord]) -> tuple[RunRecord, ...]:
    """Return one run for each kind of pictures, its technique written as "pictures".

    For figures of sizes, entropy and compression time, where a line for each technique would be
    the same line many times.
    """
    first: dict[tuple[object, ...], RunRecord] = {}
    for run in records:
        kind = (
            run.dataset,
            run.compression_query,
            run.compression_reference,
            run.encoder,
            run.jpeg_part,
            run.video,
            run.video_quality,
            run.group_length,
            run.resize,
            run.resizer,
        )
        if run.status == "ok":
            first.setdefault(kind, run)
    return tuple(
        replace(
            run,
            technique="pictures" + (f" of {run.resize} px" if run.resize else ""),
            technique_parameters="{}",
            matcher="mean",
            sequence_length="1",
            seed=0,
        )
        for run in first.values()
    )
