"""`retraverse datasets simulate`: two drives through one street, written as pictures."""

from pathlib import Path
from typing import Annotated

import typer

from retraverse.cli.options import JsonOutput
from retraverse.cli.output import print_json, progress
from retraverse.datasets.simulated import Disturbances, simulate_route, write_drive

__all__ = ["app"]

app = typer.Typer(help="Make pictures with a known truth.", no_args_is_help=True)


@app.callback()
def _group() -> None:
    """Keep `datasets` a group while it has one verb."""


def _strength(help: str) -> object:
    return typer.Option(min=0.0, max=1.0, help=help)


@app.command()
def simulate(
    folder: Annotated[Path, typer.Argument(help="Gets two folders, reference and query.")],
    frames: Annotated[int, typer.Option(help="Frames of the reference drive.")] = 120,
    seed: Annotated[int, typer.Option(min=0, help="Another seed, another street.")] = 0,
    lateral_shift: Annotated[float, _strength("Camera half a lane to the left at 1.")] = 0.0,
    season: Annotated[float, _strength("Summer 0, autumn 0.45, snow 1.")] = 0.0,
    night: Annotated[float, _strength("Day 0, dusk 0.5, night with noise 1.")] = 0.0,
    traffic: Annotated[float, _strength("Cars and people that come and go.")] = 0.0,
    fog: Annotated[float, _strength("Sight 400 m at 0, 35 m at 1.")] = 0.0,
    rain: Annotated[float, _strength("Wet road, streaks, no shadows.")] = 0.0,
    vibration: Annotated[float, _strength("Heading and pitch jitter.")] = 0.0,
    speed_change: Annotated[float, _strength("Half to twice the speed at 1.")] = 0.0,
    stops: Annotated[float, _strength("A third of the frames stand still at 1.")] = 0.0,
    revisits: Annotated[float, _strength("Half of the route driven twice at 1.")] = 0.0,
    motion: Annotated[
        str, typer.Option(help="forward, backwards, detour (leaves the map) or jump.")
    ] = "forward",
    json_output: JsonOutput = False,
) -> None:
    """Render a street twice: undisturbed as reference, disturbed as query.

    Each folder gets numbered JPEG pictures and positions.csv; `compare --radius` reads the truth
    from there.
    """
    disturbances = Disturbances(
        lateral_shift=lateral_shift,
        season=season,
        night=night,
        traffic=traffic,
        fog=fog,
        rain=rain,
        vibration=vibration,
        speed_change=speed_change,
        stops=stops,
        revisits=revisits,
    )
    route = simulate_route(seed, frames, query=disturbances, motion=motion)  # type: ignore[arg-type]
    written = {
        "reference": str(write_drive(route.reference, folder / "reference", progress=progress())),
        "query": str(write_drive(route.query, folder / "query", progress=progress())),
    }
    if json_output:
        print_json({**written, "n_references": len(route.reference), "n_queries": len(route.query)})
    else:
        print(f"{len(route.reference)} reference and {len(route.query)} query frames in {folder}")
        print(f"try: retraverse compare {written['reference']} {written['query']} --radius 5")
