"""`retraverse map build | info | extend`: the earlier drive, described once and kept."""

from pathlib import Path
from typing import Annotated

import typer

from retraverse.cli.options import (
    Cluster,
    Every,
    JsonOutput,
    MinMotion,
    Resolution,
    RuntimeName,
    Settings,
    SkipBad,
    TechniqueName,
    make_technique,
    open_drive,
    positions_of,
)
from retraverse.cli.output import print_json, print_table, progress
from retraverse.maps import RouteMap, build_map, load_map
from retraverse.studies.map_workers import describing_by

__all__ = ["app"]

app = typer.Typer(help="Build, describe and extend route maps.", no_args_is_help=True)

MapPath = Annotated[Path, typer.Argument(help="A route map: a folder made by `map build`.")]
Source = Annotated[str, typer.Argument(help="The drive: folder, glob or video.")]
Positions = Annotated[
    Path | None, typer.Option("--positions", help="CSV with a position in metres per frame.")
]


Workers = Annotated[
    int | None,
    typer.Option("--workers", min=1, help="Processes that describe, for long drives."),
]


@app.command()
def build(
    source: Source,
    out: Annotated[Path, typer.Option("--out", "-o", help="The map to write, a folder.")],
    technique: TechniqueName = "convsequential",
    settings: Settings = None,
    resolution: Resolution = None,
    runtime: RuntimeName = None,
    thumbnails: Annotated[
        int | None,
        typer.Option("--thumbnails", help="Keep pictures, longest side this many pixels."),
    ] = None,
    positions: Positions = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a map there.")] = False,
    every: Every = 1,
    skip_bad: SkipBad = False,
    min_motion: MinMotion = 0.0,
    workers: Workers = None,
    cluster: Cluster = None,
    json_output: JsonOutput = False,
) -> None:
    """Describe a drive and write it as a route map."""
    traverse = open_drive(
        source, every=every, skip_bad=skip_bad, min_motion=min_motion, progress=progress()
    )
    with describing_by(workers, cluster) as describer:
        route = build_map(
            traverse,
            make_technique(technique, settings, resolution, runtime),
            path=out,
            thumbnails=thumbnails,
            positions=None if positions is None else positions_of(traverse, positions),
            overwrite=overwrite,
            describer=describer,
            progress=progress(),
        )
    _print_info(route, json_output)


@app.command()
def info(path: MapPath, json_output: JsonOutput = False) -> None:
    """Say what a map holds and how it was made."""
    _print_info(load_map(path, progress=progress()), json_output)


@app.command()
def extend(
    path: MapPath,
    source: Source,
    positions: Positions = None,
    every: Every = 1,
    skip_bad: SkipBad = False,
    min_motion: MinMotion = 0.0,
    workers: Workers = None,
    cluster: Cluster = None,
    json_output: JsonOutput = False,
) -> None:
    """Add the frames of a further drive to the end of a map."""
    route = load_map(path, progress=progress())
    traverse = open_drive(
        source, every=every, skip_bad=skip_bad, min_motion=min_motion, progress=progress()
    )
    with describing_by(workers, cluster) as describer:
        route.extend(
            traverse,
            positions=None if positions is None else positions_of(traverse, positions),
            describer=describer,
            progress=progress(),
        )
    _print_info(route, json_output)


def _print_info(route: RouteMap, json_output: bool) -> None:
    described = route.info()
    if json_output:
        print_json(described)
    else:
        print_table([[key, str(value)] for key, value in described.items()], head=("", ""))
