"""`retraverse train …`: networks tuned or made from one's own pictures."""

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from retraverse.cli.options import (
    JsonOutput,
    Settings,
    make_technique,
    positions_of,
    read_settings,
)
from retraverse.cli.output import print_json, print_table, progress, remark
from retraverse.errors import InputError
from retraverse.images import open_traverse
from retraverse.registry import read_parameters
from retraverse.studies.measuring.quantisation import TuningPlan
from retraverse.techniques.running.extras import import_extra

if TYPE_CHECKING:
    from retraverse.training.loop import LoopSettings
    from retraverse.training.outcome import Outcome

__all__ = ["app"]

_HEAD = ("measured", "value")

app = typer.Typer(
    help="Tune networks or JPEG on your pictures, or train on your drive.", no_args_is_help=True
)

Pictures = Annotated[Path, typer.Argument(help="Pictures: a folder, or a folder of folders.")]
Classes = Annotated[Path, typer.Argument(help="One folder of pictures a class.")]
Drive = Annotated[str, typer.Argument(help="The drive of the map: folder, glob or video.")]
Out = Annotated[Path, typer.Option("--out", "-o", help="Folder for weights, report, checkpoint.")]
Technique = Annotated[
    str, typer.Option("--technique", "-t", help="Whose network: efficientnet, squeezenet, …")
]
Steps = Annotated[int | None, typer.Option("--steps", min=1, help="Updates of the weights.")]
Rate = Annotated[float | None, typer.Option("--learning-rate", help="At its highest.")]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Same seed, same training.")]
Threads = Annotated[int | None, typer.Option("--threads", min=1, help="Threads of PyTorch.")]
Resume = Annotated[
    bool, typer.Option("--resume", help="Go on where a training in the folder was stopped.")
]
Limit = Annotated[int, typer.Option("--limit", min=0, help="Take so many pictures at most.")]
Check = Annotated[
    Path | None,
    typer.Option("--check", help="Other pictures to measure on, before and after."),
]


@app.command("jpeg-distil")
def jpeg_distil(
    pictures: Pictures,
    out: Out,
    technique: Technique = "efficientnet",
    settings: Settings = None,
    steps: Steps = None,
    learning_rate: Rate = None,
    seed: Seed = 0,
    threads: Threads = None,
    limit: Limit = 0,
    start: Annotated[
        str | None,
        typer.Option("--start", help="Begin with tuned weights: a file, or jpeg (shipped)."),
    ] = None,
    how: Annotated[
        list[str] | None,
        typer.Option("--with", metavar="NAME=VALUE", help="A setting of the training; repeatable."),
    ] = None,
    check: Check = None,
    resume: Resume = False,
    json_output: JsonOutput = False,
) -> None:
    """Tune a network to not mind JPEG, without labels: any pictures will do."""
    _need_torch()
    from retraverse.training.jpeg_distil import DistilSettings, train_jpeg_distil

    values = {**read_settings("--with", how), "technique": technique}
    chosen: DistilSettings = read_parameters("jpeg-distil", DistilSettings, values)
    loop = _loop(chosen.loop, steps, learning_rate, seed, threads)
    outcome = train_jpeg_distil(
        pictures,
        out,
        replace(chosen, loop=loop),
        start=start,
        check=check,
        limit=limit,
        resume=resume,
        parameters=dict(read_settings("--set", settings)),
        progress=progress(),
    )
    _say(outcome, json_output)


@app.command("jpeg-labels")
def jpeg_labels(
    classes: Classes,
    out: Out,
    technique: Technique = "efficientnet",
    settings: Settings = None,
    steps: Steps = None,
    learning_rate: Rate = None,
    seed: Seed = 0,
    threads: Threads = None,
    limit: Limit = 0,
    check: Check = None,
    resume: Resume = False,
    json_output: JsonOutput = False,
) -> None:
    """Tune a network to not mind JPEG by classes, as the thesis does: one folder a class."""
    _need_torch()
    from retraverse.training.jpeg_labels import LabelSettings, train_jpeg_labels

    chosen = LabelSettings(technique=technique)
    loop = _loop(chosen.loop, steps, learning_rate, seed, threads)
    outcome = train_jpeg_labels(
        classes,
        out,
        replace(chosen, loop=loop),
        check=check,
        limit=limit,
        resume=resume,
        parameters=dict(read_settings("--set", settings)),
        progress=progress(),
    )
    _say(outcome, json_output)


@app.command("calc")
def calc(
    pictures: Pictures,
    out: Out,
    steps: Steps = None,
    learning_rate: Rate = None,
    seed: Seed = 0,
    threads: Threads = None,
    limit: Limit = 0,
    resume: Resume = False,
    json_output: JsonOutput = False,
) -> None:
    """Train CALC's encoder, without labels: any pictures will do."""
    _need_torch()
    from retraverse.training.calc import CalcSettings, train_calc

    loop = _loop(CalcSettings().loop, steps, learning_rate, seed, threads)
    settings = replace(CalcSettings(), loop=loop)
    outcome = train_calc(pictures, out, settings, limit=limit, resume=resume, progress=progress())
    _say(outcome, json_output)


@app.command("deepseqslam")
def deepseqslam(
    drive: Drive,
    out: Out,
    sequence_length: Annotated[
        int, typer.Option("--sequence-length", "-k", min=1, help="Frames in a window.")
    ] = 10,
    positions: Annotated[
        Path | None, typer.Option("--positions", help="CSV with a position in metres per frame.")
    ] = None,
    settings: Settings = None,
    steps: Steps = None,
    learning_rate: Rate = None,
    seed: Seed = 0,
    threads: Threads = None,
    resume: Resume = False,
    json_output: JsonOutput = False,
) -> None:
    """Train DeepSeqSLAM's LSTM on the drive of a map."""
    _need_torch()
    from retraverse.training.deepseqslam import DeepSeqSettings, train_deepseqslam

    chosen = DeepSeqSettings(sequence_length=sequence_length)
    traverse = open_traverse(drive)
    outcome = train_deepseqslam(
        traverse,
        out,
        replace(chosen, loop=_loop(chosen.loop, steps, learning_rate, seed, threads)),
        positions=None if positions is None else positions_of(traverse, positions),
        resume=resume,
        parameters=dict(read_settings("--set", settings)),
        progress=progress(),
    )
    _say(outcome, json_output)


@app.command("netvlad")
def netvlad(
    drive: Drive,
    out: Out,
    dimension: Annotated[
        int, typer.Option("--dimension", min=1, help="Numbers kept after the PCA.")
    ] = 4096,
    settings: Settings = None,
    seed: Seed = 0,
    resume: Resume = False,
    json_output: JsonOutput = False,
) -> None:
    """Make NetVLAD's clusters and PCA from the drive of a map."""
    _need_torch()
    from retraverse.training.netvlad import NetVladSettings, train_netvlad

    outcome = train_netvlad(
        drive,
        out,
        NetVladSettings(dimension=dimension, seed=seed),
        resume=resume,
        parameters=dict(read_settings("--set", settings)),
        progress=progress(),
    )
    _say(outcome, json_output)


@app.command("regionvlad")
def regionvlad(
    drive: Drive,
    out: Annotated[Path, typer.Option("--out", "-o", help="The vocabulary's file to write.")],
    settings: Settings = None,
    seed: Seed = 0,
    json_output: JsonOutput = False,
) -> None:
    """Build RegionVLAD's vocabulary from pictures of your own."""
    _need_torch()
    from retraverse.techniques.regionvlad import RegionVlad, build_vocabulary
    from retraverse.training.tuned_network import learned_technique

    technique = learned_technique("regionvlad", dict(read_settings("--set", settings)))
    assert isinstance(technique, RegionVlad)
    frames = open_traverse(drive)
    build_vocabulary(frames, out, technique=technique, seed=seed, progress=progress())
    if json_output:
        print_json({"vocabulary": str(out), "words": technique.parameters.words})
    else:
        remark(f"vocabulary: {out} (regionvlad's parameter vocabulary takes this path)")


@app.command("jpeg-tables")
def jpeg_tables(
    drive: Drive,
    out: Annotated[Path, typer.Option("--out", "-o", help="The JSON file of tables to write.")],
    technique: Annotated[
        str, typer.Option("--technique", "-t", help="Whose eyes the pictures are made for.")
    ] = "patchnorm",
    settings: Settings = None,
    compression: Annotated[
        int, typer.Option("--compression", "-c", min=1, max=99, help="c whose bytes are met.")
    ] = 95,
    probes: Annotated[
        int, typer.Option("--probes", min=2, help="Frames that are compressed in each trial.")
    ] = TuningPlan().n_probes,
    json_output: JsonOutput = False,
) -> None:
    """Tune JPEG's quantisation tables for a technique on the drive of a map.

    A plan's encoder takes the file: `encoders = [{ optimize = true, tables = "tables.json" }]`, at
    c = 50. Whether it pays depends on the technique; for most it does not.
    """
    from retraverse.studies.measuring.quantisation import tune_tables
    from retraverse.studies.plans.tables_file import save_tables

    if not out.absolute().parent.is_dir():
        # Said now and not after minutes of tuning.
        raise InputError(f"--out {out}: no folder {out.parent} to write into")
    found = tune_tables(
        open_traverse(drive),
        make_technique(technique, settings),
        TuningPlan(compression=compression, n_probes=probes),
        progress=progress(),
    )
    save_tables(out, found.tables)
    figures = {
        "bytes a picture": found.n_bytes,
        "bytes, standard tables": found.n_bytes_standard,
        "margin": found.margin,
        "margin, standard tables": found.margin_standard,
    }
    if json_output:
        print_json({"tables": str(out), "figures": figures})
        return
    print_table([(name, f"{value:.3f}") for name, value in figures.items()], head=_HEAD)
    remark(f"tables: {out} (an encoder's tables in a study's plan takes this path, at c = 50)")


def _loop(
    default: "LoopSettings",
    steps: int | None,
    learning_rate: float | None,
    seed: int,
    threads: int | None,
) -> "LoopSettings":
    """Return the default loop with what was given on the command line."""
    given: dict[str, Any] = {"steps": steps, "learning_rate": learning_rate, "threads": threads}
    known = {name: value for name, value in given.items() if value is not None}
    return replace(default, seed=seed, **known)


def _need_torch() -> None:
    import_extra("torch", "learned")


def _say(outcome: "Outcome", json_output: bool) -> None:
    files = {
        "weights": str(outcome.weights),
        "report": str(outcome.report),
        "summary": str(outcome.summary),
    }
    if json_output:
        print_json({**files, "figures": dict(outcome.figures)})
        return
    rows = [(name, f"{value:.3f}") for name, value in outcome.figures.items()]
    print_table(rows, head=_HEAD)
    remark(f"weights: {files['weights']} (a technique's parameter weights takes this path)")
    remark(f"report: {files['report']}")
