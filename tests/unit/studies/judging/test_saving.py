"""What compression saves at equal accuracy, on curves written by hand."""

import math
from dataclasses import replace

from tests.unit.reports.study_report.made_up import make_run

from retraverse.studies.judging.saving import savings
from retraverse.studies.keeping.records import RunRecord


def curve(compression: int, n_bytes: float, *accuracies: float) -> list[RunRecord]:
    """Return runs with K = 1, 2, ... at one compression of query and map."""
    return [
        replace(
            make_run(length=str(k)),
            compression_query=compression,
            compression_reference=compression,
            query_bytes_mean=n_bytes,
            query_bytes_total=-1,
            mean_sequence_length=float(k),
            descriptor_bytes=400,
            accuracy=accuracy,
        )
        for k, accuracy in enumerate(accuracies, 1)
    ]


def test_the_shortest_window_that_is_as_good() -> None:
    runs = curve(0, 1000, 0.8, 0.9, 1.0) + curve(95, 100, 0.5, 0.7, 0.8, 0.9)
    one, two = savings(runs, lengths=(1, 2))
    assert one.compressed is not None
    assert one.compressed.sequence_length == "3"
    assert (one.clean_bytes, one.descriptor_bytes, one.compressed_bytes) == (1000, 400, 300)
    assert one.frame_bytes == (1000, 400, 100)
    assert two.compressed is not None
    assert two.compressed.sequence_length == "4"
    assert (two.clean_bytes, two.descriptor_bytes, two.compressed_bytes) == (2000, 800, 400)


def test_none_is_as_good() -> None:
    (saving,) = savings(curve(0, 1000, 0.8) + curve(95, 100, 0.5, 0.7), lengths=(1,))
    assert saving.compressed is None
    assert math.isnan(saving.compressed_bytes)
    assert math.isnan(saving.frame_bytes[2])


def test_clean_is_the_weakest_compression_of_the_study() -> None:
    runs = curve(-1, 3000, 0.9) + curve(0, 1000, 0.8) + curve(50, 200, 0.7) + curve(95, 90, 0.9)
    (saving,) = savings(runs, lengths=(1,))
    assert saving.clean.compression_query == -1
    assert saving.clean_bytes == 3000


def test_query_and_map_compressed_unlike_are_left_out() -> None:
    unlike = [replace(run, compression_reference=0) for run in curve(95, 100, 0.9)]
    assert savings(curve(0, 1000, 0.8) + unlike) == []
    assert savings([]) == []
