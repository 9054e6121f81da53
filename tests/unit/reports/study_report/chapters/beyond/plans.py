"""Made-up runs of the plans beyond the thesis, with accuracies that are known."""

import hashlib
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from tests.unit.reports.study_report.made_up import make_run

from retraverse.studies.judging.selection import condition_of
from retraverse.studies.keeping.records import RunRecord

PARTS = ("luminance", "colour", "grid", "2 bands smooth")
PART_ACCURACY = {"": 0.5, "luminance": 0.55, "colour": 0.8, "grid": 0.7, "2 bands smooth": 0.3}
CLEAN = 0.85
SPEEDS = ("", ", varying speed", ", with stops")
MATCHERS = ("mean", "dtw")


def exact(accuracy: float, *arguments: Any, **values: Any) -> RunRecord:
    """Return a run of exactly one accuracy."""
    run = make_run(*arguments, chapter="beyond", accuracy=accuracy, **values)
    return replace(
        run,
        # What two plans ask for alike is one run.
        run_id=hashlib.sha256(repr((condition_of(run), run.sequence_length)).encode()).hexdigest(),
        accuracy=accuracy,
        accuracy_low=accuracy - 0.05,
        accuracy_high=min(1.0, accuracy + 0.05),
    )


def part_runs(dataset: str = "corridor", *, loss: float = 0.0) -> list[RunRecord]:
    """Return two techniques at K = 1 and 10: clean, all of JPEG, and its parts, at c = 97."""
    return [
        run
        for technique, less in (("hog", 0.0), ("cohog", 0.1))
        for length in ("1", "10")
        for run in (
            exact(CLEAN, dataset, technique, length, study="parts of JPEG"),
            *(
                exact(
                    PART_ACCURACY[part] - less - loss,
                    dataset,
                    technique,
                    length,
                    compression=(97, 97),
                    jpeg_part=part,
                    study="parts of JPEG",
                )
                for part in ("", *PARTS)
            ),
        )
    ]


def video_runs(dataset: str = "corridor") -> list[RunRecord]:
    """Return one technique: JPEG at three c against a clean map, and two codecs."""
    jpeg = ((0, 10_000.0, 0.90), (90, 2000.0, 0.86), (99, 500.0, 0.4))
    videos = {"h265": ((24, 1500.0, 0.9), (40, 500.0, 0.86)), "av1": ((32, 900.0, 0.7),)}
    common: dict[str, Any] = {"resize": 256, "study": "video codecs"}
    return [
        run
        for length in ("5", "10")
        for run in (
            *(
                exact(a, dataset, "hog", length, compression=(c, -1), query_bytes_mean=n, **common)
                for c, n, a in jpeg
            ),
            *(
                exact(a, dataset, "hog", length, video=codec, video_quality=crf, group_length=8,
                      query_bytes_mean=n, **common)
                for codec, settings in videos.items()
                for crf, n, a in settings
            ),
        )
    ]  # fmt: skip


def sending_runs(dataset: str = "corridor") -> list[RunRecord]:
    """Return one technique: descriptors in codings that are too coarse, and fine enough."""
    codings = (
        ("exact", 4000, 0.92),
        ("int8", 1004, 0.92),
        ("sketch", 132, 0.88),
        ("sketch(bits=256)", 36, 0.6),
        ("projected", 64, 0.7),
    )
    return [
        exact(
            accuracy,
            dataset,
            "hog",
            length,
            resize=256,
            descriptor_coding=name,
            coded_bytes=n_bytes,
            query_bytes_mean=9000.0,
            study="descriptors in few bytes",
        )
        for length in ("5", "10")
        for name, n_bytes, accuracy in codings
    ]


def speed_runs(dataset: str = "corridor") -> list[RunRecord]:
    """Return two techniques with two matchers at c = 0, driven in three ways."""
    return [
        exact(
            0.9 - 0.2 * at * (matcher == "mean") - 0.1 * (technique == "cohog"),
            dataset + speed,
            technique,
            "10",
            compression=(0, 0),
            matcher=matcher,
            study="changing speed",
        )
        for at, speed in enumerate(SPEEDS)
        for technique in ("hog", "cohog")
        for matcher in MATCHERS
    ]


def matcher_runs(dataset: str = "corridor") -> list[RunRecord]:
    """Return two techniques with two matchers at two c.

    The runs at c = 0 are in `speed_runs`, too, those of "mean" at c = 97 in `part_runs`.
    """
    strong = [
        exact(PART_ACCURACY[""] - less + 0.3 * (matcher == "dtw"), dataset, technique, "10",
              compression=(97, 97), matcher=matcher, study="other matchers")
        for technique, less in (("hog", 0.0), ("cohog", 0.1))
        for matcher in MATCHERS
    ]  # fmt: skip
    return [*[run for run in speed_runs(dataset) if run.dataset == dataset], *strong]


def reading_runs(dataset: str = "corridor") -> list[RunRecord]:
    """Return two techniques on three sizes; at 16 px nothing can be read."""
    sizes = ((16, math.nan, 0.95), (64, 0.1, 0.8), (256, 0.02, 1.0))
    return [
        exact(accuracy - less, dataset, technique, "10", resize=side, legible_height=height,
              study="what can be read")
        for side, height, accuracy in sizes
        for technique, less in (("hog", 0.0), ("cohog", 0.3))
    ]  # fmt: skip


def all_runs(dataset: str = "corridor") -> Sequence[RunRecord]:
    """Return the runs of all plans, those that two of them share once."""
    runs = [
        *matcher_runs(dataset),
        *speed_runs(dataset),
        *part_runs(dataset),
        *video_runs(dataset),
        *sending_runs(dataset),
        *reading_runs(dataset),
    ]
    return list({run.run_id: run for run in runs}.values())
