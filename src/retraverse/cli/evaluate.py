"""`retraverse evaluate`: matches and a ground truth in, metrics out."""

from pathlib import Path
from typing import Annotated

import numpy as np
import typer

from retraverse.cli.options import JsonOutput
from retraverse.cli.output import print_json, print_table
from retraverse.datasets import GroundTruth, aligned, from_positions, ground_truth, load_positions
from retraverse.errors import ConfigError
from retraverse.matching import Matches, load_matches
from retraverse.metrics import evaluate as evaluate_matches

__all__ = ["evaluate"]


def evaluate(
    matches: Annotated[Path, typer.Argument(help="Matches made by `retraverse localize`.")],
    truth: Annotated[
        Path | None, typer.Option("--truth", help="JSON of query frame -> list of map frames.")
    ] = None,
    aligned_frames: Annotated[
        int | None, typer.Option("--aligned", min=0, help="Truth: same frame number, ± this.")
    ] = None,
    query_positions: Annotated[
        Path | None, typer.Option("--query-positions", help="CSV of positions in metres.")
    ] = None,
    reference_positions: Annotated[
        Path | None, typer.Option("--reference-positions", help="The same, of the map.")
    ] = None,
    radius: Annotated[float, typer.Option("--radius", help="Metres that still are right.")] = 25.0,
    json_output: JsonOutput = False,
) -> None:
    """Judge matches by a ground truth; every number comes with its definition."""
    loaded = load_matches(matches)
    if truth is not None:
        known = ground_truth(truth)
    elif aligned_frames is not None:
        known = aligned(loaded.n_queries, loaded.n_references, tolerance=aligned_frames)
    elif query_positions is not None and reference_positions is not None:
        known = from_positions(
            load_positions(query_positions), load_positions(reference_positions), radius_m=radius
        )
    else:
        raise ConfigError(
            "no ground truth: expected --truth FILE, --aligned FRAMES, or --query-positions FILE "
            "with --reference-positions FILE"
        )
    _print_evaluation(loaded, known, json_output)


def _print_evaluation(matches: Matches, truth: GroundTruth, json_output: bool) -> None:
    result = evaluate_matches(matches, truth)
    numbers = result.to_dict()
    if json_output:
        print_json({**numbers, "truth": truth.description, "definitions": result.definitions})
        return
    print(truth.description)
    rows = [
        [name, _text(value), result.definitions.get(name, "")]
        for name, value in numbers.items()
        if value is not None
    ]
    print_table(rows, head=("metric", "value", "definition"))


def _text(value: object) -> str:
    if isinstance(value, (float, np.floating)):
        return f"{value:.4f}"
    if isinstance(value, (list, tuple)):
        return " to ".join(_text(item) for item in value)
    return str(value)
