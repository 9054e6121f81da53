"""`retraverse study`: a grid of runs from a plan, checked, run, resumed and shown."""

from collections import Counter
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from retraverse.cli.options import Cluster, JsonOutput, ShowPictures
from retraverse.cli.output import print_json, print_table, progress, remark

if TYPE_CHECKING:
    from retraverse.studies.keeping.records import RunRecord

__all__ = ["app", "check", "print_expectations", "report", "run", "show"]

app = typer.Typer(no_args_is_help=True, help="Run a grid of settings on your datasets.")

PlanPath = Annotated[Path, typer.Argument(help="The plan, a TOML file.")]
OutPath = Annotated[
    Path, typer.Option("--out", "-o", help="The study's folder: records, cache, plan.")
]
DataRoot = Annotated[
    Path | None,
    typer.Option("--data", help="Folder of the datasets, in place of the plan's."),
]
CachePath = Annotated[
    Path | None,
    typer.Option("--cache", help="Where descriptors are kept, to share them between studies."),
]
Workers = Annotated[
    int | None,
    typer.Option("--workers", min=0, help="Processes of this machine. [default: its cores]"),
]


@app.command("run")
def run(
    plan: PlanPath,
    out: OutPath,
    data: DataRoot = None,
    cache: CachePath = None,
    workers: Workers = None,
    cluster: Cluster = None,
    skip_missing: Annotated[
        bool, typer.Option("--skip-missing", help="Run without the datasets that are not here.")
    ] = False,
    json_output: JsonOutput = False,
) -> None:
    """Run a plan; what is done already is kept, so run it again after a break."""
    from retraverse.studies.engine import run_study
    from retraverse.studies.plans.plan_file import load_plan

    on_missing = "record" if skip_missing else "refuse"
    result = run_study(
        load_plan(plan, data=data, on_missing=on_missing),
        out,
        workers=workers,
        cluster=cluster,
        cache=cache,
        progress=progress(),
    )
    if json_output:
        print_json({**asdict(result), "folder": str(result.folder)})
        return
    print(
        f"{result.n_runs} runs: {result.n_ok} done now, {result.n_kept} before, "
        f"{result.n_failed} failed, {result.n_missing} missing; "
        f"{result.n_described} pictures described, {result.seconds:.1f} s"
    )
    if result.n_failed + result.n_missing:
        _print_reasons(out)
    print(f"study: {out}")


@app.command("check")
def check(
    plan: PlanPath,
    out: OutPath = Path("study"),
    data: DataRoot = None,
    cache: CachePath = None,
    workers: Workers = None,
    json_output: JsonOutput = False,
) -> None:
    """Check all of a plan and estimate runs, time and disk; nothing is run or written."""
    from retraverse.errors import InputError
    from retraverse.maps.describe import available_cores
    from retraverse.studies.estimate import estimate_study
    from retraverse.studies.plans.plan_file import load_plan

    n_workers = available_cores() if workers is None else workers
    estimate = estimate_study(
        load_plan(plan, data=data), out, workers=n_workers, cache=cache, progress=progress()
    )
    if json_output:
        print_json({**asdict(estimate), "workers": n_workers})
    else:
        print(f"runs: {estimate.n_runs}")
        print(f"pictures to describe: {estimate.n_pictures}")
        print(f"time: about {_duration(estimate.seconds)} with {n_workers} workers")
        print(f"disk: about {estimate.n_bytes / 1e6:.0f} MB")
    if estimate.problems:
        raise InputError("\n  ".join([f"plan {plan}: tried, and failed:", *estimate.problems]))


@app.command("show")
def show(
    out: Annotated[Path, typer.Argument(help="The study's folder.")],
    json_output: JsonOutput = False,
) -> None:
    """Show what a study has found so far: one line a run."""
    from retraverse.studies.keeping.study_folder import read_study

    records = read_study(out)
    if json_output:
        print_json([_brief(record) for record in records])
        return
    rows = [list(map(str, _line(record))) for record in records]
    settings = ("dataset", "technique", "matcher", "K", "c", "size", "sent")
    head = [*settings, "accuracy", "AUC", "status"]
    at = head.index("sent")
    if all(row[at] == "pictures" for row in rows):  # Of interest where something else was.
        rows = [row[:at] + row[at + 1 :] for row in rows]
        head.remove("sent")
    print_table(rows, head=tuple(head))


@app.command("report")
def report(
    study: Annotated[Path, typer.Argument(help="The study's folder, or a folder of several.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder to write into.")] = Path(
        "study-report"
    ),
    data: Annotated[
        Path | None,
        typer.Option("--data", help="Data root, if datasets are not where the plan found them."),
    ] = None,
    cache: CachePath = None,
    published: Annotated[
        bool, typer.Option(help="Print the thesis' values beside ours where they apply.")
    ] = True,
    pictures: ShowPictures = True,
) -> None:
    """Write a study's report: a folder of pages that open from disk."""
    from retraverse.cli.view import pictures_of
    from retraverse.reports import write_study_report

    index = write_study_report(
        study,
        out,
        published=published,
        pictures=pictures_of(study, data) if pictures else None,
        cache=cache,
        progress=progress(),
    )
    print_expectations(study)
    print(f"report: {index}")


def print_expectations(study: Path) -> None:
    """Print what the thesis leads one to expect, and whether these records bear it out."""
    from retraverse.studies.judging.expectations import check_expectations
    from retraverse.studies.keeping.light_records import read_light_records, study_folders

    for expectation in check_expectations(read_light_records(study_folders(study))):
        print(f"{expectation.verdict}: {expectation.claim} {expectation.numbers}")


def _line(record: "RunRecord") -> tuple[Any, ...]:
    """Return a record as a row of a table."""
    brief = _brief(record)
    shown = f"{record.accuracy:.3f} ({record.accuracy_low:.2f}-{record.accuracy_high:.2f})"
    brief["c"] = f"{brief['c']} {brief['part']}".strip()
    names = ("dataset", "technique", "matcher", "K", "c", "resize", "sent as")
    return (*(brief[name] for name in names), shown, brief["AUC"], brief["status"])


def _brief(record: "RunRecord") -> dict[str, Any]:
    """Return the columns a person looks at first."""
    from retraverse.studies.judging.selection import bytes_sent

    is_ok = record.status == "ok"
    sides = (record.compression_query, record.compression_reference)
    return {
        "dataset": record.dataset,
        "technique": record.technique,
        "matcher": record.matcher,
        "K": record.sequence_length,
        "c": "/".join("none" if side < 0 else str(side) for side in sides),
        "part": record.jpeg_part,
        "resize": record.resize or "none",
        "accuracy": round(record.accuracy, 3),
        "low": round(record.accuracy_low, 3),
        "high": round(record.accuracy_high, 3),
        "AUC": round(record.auc, 3),
        "sent as": _sent(record),
        "bytes": round(bytes_sent(record)) if is_ok else bytes_sent(record),
        "t_VPR ms": round(record.vpr_s * 1e3, 3),
        "status": record.status if is_ok else f"{record.status}: {record.error}",
    }


def _sent(record: "RunRecord") -> str:
    """Return what travelled: "pictures", "H.265 crf 36, groups of 8", or descriptors: "int8"."""
    from retraverse.reports.study_report.words import damage_text

    pictures = damage_text(record) if record.video else ""
    return ", ".join(filter(None, (pictures, record.descriptor_coding))) or "pictures"


def _print_reasons(out: Path) -> None:
    """Say why runs failed, each reason once."""
    from retraverse.studies.keeping.study_folder import read_study

    reasons = Counter(
        f"{record.status}: {record.error}" for record in read_study(out) if record.status != "ok"
    )
    for reason, count in reasons.most_common():
        remark(f"{count} runs {reason}")


def _duration(seconds: float) -> str:
    if seconds < 90:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 5400 else f"{seconds / 3600:.1f} h"
