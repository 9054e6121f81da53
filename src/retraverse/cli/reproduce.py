"""`retraverse reproduce`: the thesis' studies on the datasets that are here, and their report."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from retraverse.cli.options import JsonOutput, ShowPictures
from retraverse.cli.output import print_json, progress, remark
from retraverse.cli.study import print_expectations

if TYPE_CHECKING:
    from retraverse.studies.engine import StudyResult
    from retraverse.studies.plans.plan import StudyPlan

__all__ = ["reproduce"]


def reproduce(
    data: Annotated[Path, typer.Argument(help="Folder with one folder for each dataset.")],
    out: Annotated[
        Path, typer.Option("--out", "-o", help="Folder of the studies and their report.")
    ] = Path("reproduction"),
    chapter: Annotated[
        list[str] | None,
        typer.Option("--chapter", help="3 to 7, or beyond; again for more. [default: all]"),
    ] = None,
    dataset: Annotated[
        list[str] | None,
        typer.Option("--dataset", help="A dataset's name; again for more. [default: all known]"),
    ] = None,
    workers: Annotated[
        int | None,
        typer.Option("--workers", min=1, help="Processes of this machine. [default: its cores]"),
    ] = None,
    cluster: Annotated[
        str | None,
        typer.Option("--cluster", help="Dask: tcp://HOST:PORT, tls://HOST:PORT, or local:WORKERS."),
    ] = None,
    pictures: ShowPictures = True,
    json_output: JsonOutput = False,
) -> None:
    """Run the thesis' studies on your data; what is done is kept, so run it again after a break."""
    from retraverse.studies.engine import run_study
    from retraverse.studies.reproduce import CHAPTERS, chapter_plans

    plans = chapter_plans(data, chapters=tuple(chapter or CHAPTERS), datasets=tuple(dataset or ()))
    results = {}
    for plan in plans:
        remark(f"{plan.name}: {plan.n_runs} runs")
        results[plan.name] = run_study(
            plan,
            out / "studies" / _folder(plan),
            workers=workers,
            cluster=cluster,
            cache=out / "cache",
            progress=progress(),
        )
    index = _report(out, data, with_pictures=pictures)
    if json_output:
        print_json(_summary(results, index))
        return
    for name, result in results.items():
        print(
            f"{name}: {result.n_runs} runs, {result.n_ok} done now, {result.n_kept} before, "
            f"{result.n_failed} failed, {result.n_missing} missing, {result.seconds:.0f} s"
        )
    print_expectations(out / "studies")
    print(f"report: {index}")


def _folder(plan: "StudyPlan") -> str:
    return plan.name.replace(",", "").replace(" ", "-")


def _report(out: Path, data: Path, *, with_pictures: bool) -> Path:
    from retraverse.cli.view import pictures_of
    from retraverse.reports import write_study_report

    return write_study_report(
        out / "studies",
        out / "report",
        cache=out / "cache",
        pictures=pictures_of(out / "studies", data) if with_pictures else None,
        progress=progress(),
    )


def _summary(results: "dict[str, StudyResult]", index: Path) -> dict[str, Any]:
    from dataclasses import asdict

    return {
        "studies": {
            name: {**asdict(result), "folder": str(result.folder)}
            for name, result in results.items()
        },
        "report": str(index),
    }
