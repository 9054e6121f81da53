"""`retraverse compare`: two drives in, the matched route and its report out."""

import shlex
import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from retraverse.cli.options import (
    Aligned,
    Every,
    JsonOutput,
    MatcherName,
    MatcherSettings,
    MinMotion,
    Radius,
    Resolution,
    RuntimeName,
    Settings,
    SkipBad,
    TechniqueName,
    Threshold,
    TruthPath,
    make_matcher,
    make_technique,
    open_drive,
    read_sequence_length,
    read_truth,
)
from retraverse.cli.output import print_json, progress, remark
from retraverse.files import check_writable_place
from retraverse.images import Traverse
from retraverse.studies import ComparePlan, ComparisonRecord
from retraverse.studies import compare as compare_traverses
from retraverse.types import Progress

__all__ = ["compare", "summarise"]


def compare(
    reference: Annotated[str, typer.Argument(help="The earlier drive: folder, glob or video.")],
    query: Annotated[str, typer.Argument(help="The drive to locate on it.")],
    truth: TruthPath = None,
    aligned: Aligned = None,
    radius: Radius = None,
    technique: TechniqueName = "convsequential",
    settings: Settings = None,
    resolution: Resolution = None,
    runtime: RuntimeName = None,
    matcher: MatcherName = "mean",
    matcher_settings: MatcherSettings = None,
    sequence_length: Annotated[
        str | None,
        typer.Option(
            "--sequence-length",
            "-k",
            help="Frames in a window: 1, a whole number, or dynamic. "
            "[default: dynamic; 10 for matchers other than mean]",
            show_default=False,
        ),
    ] = None,
    threshold: Threshold = None,
    out: Annotated[Path, typer.Option("--out", "-o", help="The report, one HTML file.")] = Path(
        "report.html"
    ),
    every: Every = 1,
    skip_bad: SkipBad = False,
    min_motion: MinMotion = 0.0,
    json_output: JsonOutput = False,
) -> None:
    """Locate one drive on another and write a report.

    The report is one HTML page that opens without network: matched path, scores, pictures side
    by side, times, and, where the truth is known, accuracy and precision.
    """
    check_writable_place(out)
    plan = ComparePlan(
        technique=make_technique(technique, settings, resolution, runtime),
        sequence_length=read_sequence_length(
            sequence_length or ("dynamic" if matcher == "mean" else "10")
        ),
        matcher=make_matcher(matcher, matcher_settings),
        threshold=threshold,
        command=shlex.join(["retraverse", *sys.argv[1:]]),
    )
    show = progress()
    reference_traverse, query_traverse = (
        open_drive(source, every=every, skip_bad=skip_bad, min_motion=min_motion, progress=show)
        for source in (reference, query)
    )
    record = compare_traverses(
        reference_traverse,
        query_traverse,
        plan,
        read_truth(
            truth,
            aligned,
            radius,
            query=query_traverse,
            reference=reference_traverse,
            every=every,
        ),
        progress=show,
    )
    write_report(record, out, reference_traverse, query_traverse, show)
    if json_output:
        print_json(summarise(record, out))
    else:
        print_summary(record, out)


def write_report(
    record: ComparisonRecord, out: Path, reference: Traverse, query: Traverse, show: Progress
) -> None:
    """Write the report of a comparison."""
    from retraverse.reports import write_comparison_report

    write_comparison_report(record, out, reference=reference, query=query, progress=show)


def print_summary(record: ComparisonRecord, out: Path) -> None:
    """Print the few lines a person wants first."""
    matches, times = record.matches, record.times
    print(
        f"{len(matches)} of {matches.n_queries} frames of {record.query.name} located on "
        f"{record.reference.name} ({matches.n_references} frames), windows of "
        f"{matches.sequence_length.min()} to {matches.sequence_length.max()} frames"
    )
    if record.evaluation is not None and record.truth is not None:
        low, high = record.evaluation.accuracy_interval
        print(
            f"accuracy {record.evaluation.accuracy:.3f} (95 % interval {low:.3f} to {high:.3f}) "
            f"of the windows answered, {record.evaluation.accuracy_all_queries:.3f} of all frames; "
            f"{record.truth.description}"
        )
        print(
            f"AUC {record.evaluation.auc:.3f} (thesis), {record.evaluation.auc_single:.3f} "
            f"(single); recall at full precision {record.evaluation.r_p100:.3f}"
        )
    print(
        f"t_e {times.encode_s * 1e3:.1f} ms a frame, t_m {times.match_s * 1e3:.1f} ms a window, "
        f"t_VPR {times.vpr_s * 1e3:.1f} ms; {times.total_s:.1f} s in all"
    )
    for note in record.notes:
        remark(f"note: {note}")
    print(f"report: {out}")


def summarise(record: ComparisonRecord, out: Path | None = None) -> dict[str, Any]:
    """Return the result as plain values, for JSON."""
    from dataclasses import asdict

    matches = record.matches
    return {
        "reference": record.reference.source,
        "query": record.query.source,
        "n_queries": matches.n_queries,
        "n_references": matches.n_references,
        "n_answered": len(matches),
        "n_unanswered": matches.n_unanswered,
        "evaluation": record.evaluation and record.evaluation.to_dict(),
        "truth": record.truth and record.truth.description,
        "times": asdict(record.times),
        "provenance": asdict(record.provenance),
        "notes": record.notes,
        "matches": {
            "query": matches.query,
            "reference": matches.reference,
            "score": matches.score,
            "sequence_length": matches.sequence_length,
        },
        "report": None if out is None else str(out),
    }
