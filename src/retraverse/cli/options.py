"""Options that several verbs share, and how their text becomes values."""

from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
import typer
from numpy.typing import NDArray

from retraverse.cli.output import remark
from retraverse.datasets import GroundTruth, aligned, from_positions, ground_truth, load_positions
from retraverse.errors import ConfigError, InputError
from retraverse.images import Traverse, open_traverse, without_stops
from retraverse.matching.matchers import Matcher, matcher
from retraverse.techniques import Technique, technique
from retraverse.types import Progress

__all__ = [
    "Aligned",
    "Every",
    "JsonOutput",
    "MatcherName",
    "MatcherSettings",
    "MinMotion",
    "Radius",
    "Resolution",
    "RuntimeName",
    "SequenceLengthText",
    "Settings",
    "ShowPictures",
    "SkipBad",
    "TechniqueName",
    "Threshold",
    "TruthPath",
    "make_matcher",
    "make_technique",
    "on_runtime",
    "open_drive",
    "positions_of",
    "read_sequence_length",
    "read_settings",
    "read_truth",
]

TechniqueName = Annotated[
    str, typer.Option("--technique", "-t", help="One of `retraverse techniques`.")
]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME=VALUE", help="A parameter of the technique; repeatable."),
]
MatcherName = Annotated[str, typer.Option("--matcher", "-m", help="One of `retraverse matchers`.")]
MatcherSettings = Annotated[
    list[str] | None,
    typer.Option(
        "--matcher-set", metavar="NAME=VALUE", help="A parameter of the matcher; repeatable."
    ),
]
SequenceLengthText = Annotated[
    str,
    typer.Option(
        "--sequence-length", "-k", help="Frames in a window: 1, a whole number, or dynamic."
    ),
]
Resolution = Annotated[
    int | None,
    typer.Option("--resolution", help="Side in pixels that pictures are described at."),
]
RuntimeName = Annotated[
    Literal["torch", "onnx"] | None,
    typer.Option("--runtime", help="What runs the network of a learned technique."),
]
MinMotion = Annotated[
    float,
    typer.Option(
        "--min-motion", min=0, help="Leave out frames that changed less; 0.05 removes stops."
    ),
]
Threshold = Annotated[
    float | None,
    typer.Option("--threshold", help="Answer “no match” where a window scores below this."),
]
Every = Annotated[int, typer.Option("--every", min=1, help="Take every N-th frame only.")]
SkipBad = Annotated[
    bool, typer.Option("--skip-bad", help="Leave out pictures that cannot be read, and say so.")
]
ShowPictures = Annotated[
    bool,
    typer.Option(
        help="Show the datasets' pictures in the report; without them it can be passed on."
    ),
]
JsonOutput = Annotated[bool, typer.Option("--json", help="Print the result as JSON.")]
TruthPath = Annotated[
    Path | None,
    typer.Option("--truth", help="Ground truth: JSON of query frame -> list of map frames."),
]
Aligned = Annotated[
    int | None,
    typer.Option("--aligned", min=0, metavar="FRAMES", help="Truth: same frame number, ± this."),
]
Radius = Annotated[
    float | None,
    typer.Option("--radius", metavar="METRES", help="Truth: positions.csv in both folders."),
]

Cluster = Annotated[
    str | None,
    typer.Option("--cluster", help="Dask: tcp://HOST:PORT, tls://HOST:PORT, or local:WORKERS."),
]


def open_drive(
    source: str, *, every: int, skip_bad: bool, min_motion: float, progress: Progress
) -> Traverse:
    """Return the frames of a drive that the options leave; what is left out is said."""
    whole = open_traverse(source, every=every, skip_bad=skip_bad, progress=progress)
    for frame in whole.skipped:
        remark(f"left out {frame.name}: {frame.reason}")
    moving = without_stops(whole, min_motion, progress=progress)
    if len(moving) < len(whole):
        remark(f"left out {len(whole) - len(moving)} of {len(whole)} frames of {whole.name}: stops")
    return moving


def make_technique(
    name: str,
    settings: list[str] | None,
    resolution: int | None = None,
    runtime: str | None = None,
) -> Technique:
    """Return the technique with ``name=value`` settings and the options beside them applied."""
    values = read_settings("--set", settings)
    for key, value in (("resolution", resolution), ("runtime", runtime)):
        if value is None:
            continue
        if key in values:
            raise ConfigError(f"got --{key} and --set {key}=…, expected one of them")
        values[key] = str(value)
    return technique(name, **values)


def on_runtime(described_by: Technique, runtime: str) -> Technique:
    """Return the same technique run by another runtime."""
    return technique(described_by.name, **{**asdict(described_by.parameters), "runtime": runtime})


def make_matcher(name: str, settings: list[str] | None) -> Matcher:
    """Return the matcher with ``name=value`` settings applied."""
    return matcher(name, **read_settings("--matcher-set", settings))


def read_settings(option: str, settings: list[str] | None) -> dict[str, str]:
    """Return NAME=VALUE texts as a dict; ConfigError if one has no ``=``."""
    values: dict[str, str] = {}
    for setting in settings or []:
        key, separator, value = setting.partition("=")
        if not separator:
            raise ConfigError(f"{option}: got {setting!r}, expected NAME=VALUE")
        values[key.strip()] = value.strip()
    return values


def read_sequence_length(text: str) -> int | Literal["dynamic"]:
    """Return "dynamic" or a whole number from 1."""
    if text == "dynamic":
        return "dynamic"
    if not text.isascii() or not text.isdigit() or int(text) < 1:
        raise ConfigError(
            f"--sequence-length: got {text!r}, expected a whole number from 1, or dynamic"
        )
    return int(text)


def read_truth(
    truth: Path | None,
    aligned_frames: int | None,
    radius_m: float | None,
    *,
    query: Traverse,
    reference: Traverse,
    every: int = 1,
) -> GroundTruth | None:
    """Return the ground truth the options name, or None where they name none.

    Frames left out by ``--skip-bad`` are left out of the truth too. ``--truth`` speaks of the
    frame numbers of the source, ``--aligned`` of the frames that ``--every`` keeps.
    """
    options = {"--truth": truth, "--aligned": aligned_frames, "--radius": radius_m}
    given = [name for name, value in options.items() if value is not None]
    if len(given) > 1:
        raise ConfigError(f"got {' and '.join(given)}, expected one of them: which is the truth?")
    if truth is not None:
        return ground_truth(truth).select(query.indices, reference.indices)
    if aligned_frames is not None:
        return _aligned(query, reference, aligned_frames, every)
    if radius_m is not None:
        return from_positions(
            _positions_beside(query), _positions_beside(reference), radius_m=radius_m
        )
    return None


def _aligned(query: Traverse, reference: Traverse, tolerance: int, every: int) -> GroundTruth:
    kept_queries, kept_references = query.indices // every, reference.indices // every
    whole = aligned(
        int(kept_queries.max()) + 1, int(kept_references.max()) + 1, tolerance, every=every
    )
    return whole.select(kept_queries, kept_references)


def positions_of(traverse: Traverse, table: Path) -> NDArray[np.float64]:
    """Return the positions of the frames that were read, from a table of the whole drive."""
    positions = load_positions(table)
    if len(positions) <= traverse.indices.max():
        raise InputError(
            f"positions {table}: got {len(positions)} rows, expected at least "
            f"{traverse.indices.max() + 1}, one per picture of {traverse.name}"
        )
    return positions[traverse.indices]


def _positions_beside(traverse: Traverse) -> NDArray[np.float64]:
    """Return the positions of a traverse's frames from the table in its folder."""
    path = traverse[0].path
    table = None if path is None else path.parent / "positions.csv"
    if table is None or not table.is_file():
        raise InputError(
            f"--radius: no positions.csv beside the pictures of {traverse.name}; expected a table "
            "of metres, one row per picture"
        )
    return positions_of(traverse, table)
