"""`retraverse localize`: a drive and a map in, one row of matches per frame out."""

from pathlib import Path
from typing import Annotated

import typer

from retraverse.cli.options import (
    Every,
    JsonOutput,
    MatcherName,
    MatcherSettings,
    MinMotion,
    RuntimeName,
    SequenceLengthText,
    SkipBad,
    Threshold,
    make_matcher,
    on_runtime,
    open_drive,
    read_sequence_length,
)
from retraverse.cli.output import print_json, progress, remark
from retraverse.files import check_writable_place
from retraverse.maps import load_map
from retraverse.matching import match, save_matches

__all__ = ["localize"]


def localize(
    route: Annotated[Path, typer.Argument(help="The route map.")],
    query: Annotated[str, typer.Argument(help="The drive to locate: folder, glob or video.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="The matches, CSV.")] = Path(
        "matches.csv"
    ),
    matcher: MatcherName = "mean",
    matcher_settings: MatcherSettings = None,
    sequence_length: SequenceLengthText = "10",
    threshold: Threshold = None,
    runtime: RuntimeName = None,
    every: Every = 1,
    skip_bad: SkipBad = False,
    min_motion: MinMotion = 0.0,
    json_output: JsonOutput = False,
) -> None:
    """Locate a drive on a map and write the matches as CSV."""
    check_writable_place(out)
    show = progress()
    loaded = load_map(route, progress=show)
    if runtime is not None:
        loaded = loaded.with_technique(on_runtime(loaded.technique, runtime))
    traverse = open_drive(
        query, every=every, skip_bad=skip_bad, min_motion=min_motion, progress=show
    )
    matches = match(
        traverse,
        loaded,
        sequence_length=read_sequence_length(sequence_length),
        matcher=make_matcher(matcher, matcher_settings),
        threshold=threshold,
        progress=show,
    )
    save_matches(
        matches,
        out,
        query_names=[frame.name for frame in traverse],
        reference_names=loaded.frames.names,
    )
    for note in matches.notes:
        remark(f"note: {note}")
    counts = {
        "matches": str(out),
        "n_queries": matches.n_queries,
        "n_answered": len(matches),
        "n_refused": int((~matches.is_match).sum()),
        "n_unanswered": matches.n_unanswered,
        "notes": matches.notes,
    }
    if json_output:
        print_json(counts)
    else:
        print(
            f"{counts['n_answered']} of {counts['n_queries']} frames answered "
            f"({counts['n_refused']} with “no match”), {counts['n_unanswered']} not: {out}"
        )
