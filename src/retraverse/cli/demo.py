"""`retraverse demo`: the main job on a simulated street, from nothing to a report."""

import shutil
from pathlib import Path
from typing import Annotated

import typer

from retraverse.cli.compare import print_summary, write_report
from retraverse.cli.options import SequenceLengthText, TechniqueName, read_sequence_length
from retraverse.cli.output import progress
from retraverse.datasets import from_positions, load_positions
from retraverse.datasets.simulated import Disturbances, simulate_route, write_drive
from retraverse.errors import InputError
from retraverse.images import open_traverse
from retraverse.studies import ComparePlan
from retraverse.studies import compare as compare_traverses
from retraverse.techniques import technique as make_technique

__all__ = ["demo"]

QUERY = Disturbances(
    lateral_shift=0.8, season=0.95, night=0.3, traffic=0.9, vibration=0.6, speed_change=0.4
)
"""A late winter afternoon: snow, 1.3 m further left, dense traffic, an unsteady camera and speed.

Hard enough that single frames go wrong where windows of frames do not, and that some windows
still do.
"""
RADIUS_M = 4.0
MARKER = ".retraverse-demo"


def demo(
    out: Annotated[
        Path, typer.Option("--out", "-o", help="Folder for pictures and report.")
    ] = Path("demo"),
    frames: Annotated[int, typer.Option(min=2, help="Frames of the first drive.")] = 120,
    seed: Annotated[int, typer.Option(min=0, help="Another seed, another street.")] = 0,
    technique: TechniqueName = "convsequential",
    sequence_length: SequenceLengthText = "dynamic",
) -> None:
    """Render a street in summer and in winter, and locate one drive on the other."""
    _make_room(out)
    show = progress()
    route = simulate_route(seed, frames, query=QUERY)
    print(f"a street with seed {seed}, driven in summer ({len(route.reference)} frames) and in")
    print(f"snow at the end of the day, further left, in traffic ({len(route.query)} frames)")
    folders = [
        write_drive(route.reference, out / "summer", progress=show),
        write_drive(route.query, out / "winter", progress=show),
    ]
    reference, query = (open_traverse(folder) for folder in folders)
    first, second = (load_positions(folder / "positions.csv") for folder in folders)
    truth = from_positions(second, first, radius_m=RADIUS_M)
    command = f"retraverse compare {folders[0]} {folders[1]} --radius {RADIUS_M:g}"
    plan = ComparePlan(
        make_technique(technique), read_sequence_length(sequence_length), command=command
    )
    record = compare_traverses(reference, query, plan, truth, progress=show)
    write_report(record, out / "report.html", reference, query, show)
    print_summary(record, out / "report.html")
    print("open the report in a browser; the same on your own pictures:")
    print("  retraverse compare FIRST_DRIVE SECOND_DRIVE")


def _make_room(out: Path) -> None:
    """Empty a folder of an earlier demonstration; anything else in the way is not touched."""
    if out.exists():
        if not (out / MARKER).is_file():
            raise InputError(
                f"{out} is there already and was not made by `retraverse demo`; "
                "expected a new folder, give one with --out"
            )
        shutil.rmtree(out)
    out.mkdir(parents=True)
    (out / MARKER).touch()
