"""Print docs/matching.md's tables: technique x matcher, at constant and at disturbed speeds.

Run: .venv/bin/python benchmarks/matching_table.py [DATA_FOLDER] > table.md

Every cell is the share of query frames whose own answer (`Matches.by_frame`) is right, over the
same query frames for every matcher; a frame off the map is right when answered "no match".
Differences to the mean are paired: 95 % circular block bootstrap (blocks of K = 10 frames) of the
per-frame difference, seed 0. A disturbed drive is the real query drive resampled by a seeded speed
profile (`retraverse.datasets.resample`), so all its scores are rows of one similarity matrix; its
three seeds are joined into one row of frames. K = 10 everywhere; all parameters are defaults.
"""

import time
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from _real_sets import FOLDERS, data_folder

import retraverse as rt
from retraverse.datasets import from_positions
from retraverse.datasets.resample import PROFILES, Resampling, plan_resampling
from retraverse.matching import describe_query
from retraverse.metrics import bootstrap_interval
from retraverse.types import BoolArray, FloatArray

K = 10
SEEDS = (0, 1, 2)
WHOLE_LINE = "whole line"
TECHNIQUES: list[tuple[str, dict[str, Any]]] = [
    ("hog", {"form": "chapter6"}),
    ("hog", {"form": "chapter7", "resolution": 64}),
    ("gist", {}),
    ("orb", {}),
    ("sad", {}),
    ("patchnorm", {}),
    ("cohog", {"precision": "int8"}),
    ("convsequential", {"precision": "int8"}),
]
ON_THE_WHOLE_LINE = ("hog", "gist", "sad", "patchnorm")
MATCHERS = [info.name for info in rt.matchers()]


@dataclass(frozen=True)
class Drive:
    """All recorded query frames against a map, and which recorded frames one map step is."""

    name: str
    reference: rt.Traverse
    query: rt.Traverse
    truth: rt.GroundTruth
    spacing: float


def drives() -> list[Drive]:
    """Return the real drives that are here; the query is unthinned, so that it can be resampled."""
    found = []
    for name, (reference_folder, query_folder, every, tolerance) in FOLDERS.items():
        folder = data_folder() / name
        if not folder.is_dir():
            print(f"\n{name}: not here")
            continue
        whole = rt.open_traverse(folder / reference_folder)
        query = rt.open_traverse(folder / query_folder)
        for thinned in sorted({every, 1}, reverse=True):
            label = name if thinned == every else f"{name}, {WHOLE_LINE}"
            reference = whole.thinned(thinned)
            truth = from_positions(
                query.indices[:, np.newaxis],
                reference.indices[:, np.newaxis],
                radius_m=float(tolerance * thinned),
            )
            found.append(Drive(label, reference, query, truth, float(thinned)))
    return found


def is_right(scores: FloatArray, truth: rt.GroundTruth, matcher: str) -> BoolArray:
    """Return for every query frame whether its own answer is right, bool (Q,)."""
    matches = rt.match_similarity(scores, sequence_length=K, matcher=matcher).by_frame()
    answered = matches.reference
    refused_rightly = (answered == -1) & ~truth.has_match()
    return np.asarray(truth.is_correct(matches.query, answered) | refused_rightly)


def disturbed(
    scores: FloatArray, drive: Drive, resampling: Resampling
) -> tuple[FloatArray, rt.GroundTruth]:
    """Return the matrix and the truth of the drive driven again."""
    kept = resampling.map_frames(drive.truth)
    return scores[np.ix_(resampling.frames, kept)], resampling.truth(drive.truth)


Shares = dict[str, float]


def main() -> None:
    found: dict[tuple[str, str], list[Shares]] = {}
    for drive in drives():
        whole_line = WHOLE_LINE in drive.name
        profiles = ("constant", "varying") if whole_line else tuple(PROFILES)
        print(f"\n### {drive.name}\n")
        print(f"{len(drive.reference)} references, ±{drive.truth.description.split()[-2]} files.\n")
        print(
            f"| technique | speed | frames | {' | '.join(MATCHERS)} | best − mean | auto − mean |"
        )
        print(f"|{'---|' * (len(MATCHERS) + 5)}")
        for name, parameters in TECHNIQUES:
            if whole_line and name not in ON_THE_WHOLE_LINE:
                continue
            for profile, shares in print_technique(drive, name, parameters, profiles):
                found.setdefault((profile, drive.name), []).append(shares)
    print_summary(found)


def print_summary(found: dict[tuple[str, str], list[Shares]]) -> None:
    """Print the mean over techniques, by speed and drive."""
    print("\n### Mean over techniques\n")
    print(f"| speed | drive | techniques | {' | '.join(MATCHERS)} |")
    print(f"|{'---|' * (len(MATCHERS) + 3)}")
    for (profile, drive), rows in sorted(found.items()):
        means = [float(np.mean([row[matcher] for row in rows])) for matcher in MATCHERS]
        shown = " | ".join(f"{mean:.3f}" for mean in means)
        print(f"| {profile} | {drive} | {len(rows)} | {shown} |")


def print_technique(
    drive: Drive, name: str, parameters: dict[str, Any], profiles: tuple[str, ...]
) -> Iterator[tuple[str, Shares]]:
    """Print one row per speed profile and yield the shares it shows."""
    route = rt.build_map(drive.reference, rt.technique(name, **parameters))
    scores = rt.similarity(describe_query(drive.query, route), route)
    settings = "".join(f" {value}" for value in parameters.values())
    for profile in profiles:
        # A constant speed has nothing to draw, and the whole line is long enough for one seed.
        long = len(drive.query) > 3000 and drive.spacing == 1
        seeds = SEEDS[:1] if profile == "constant" or long else SEEDS
        right: dict[str, list[BoolArray]] = {matcher: [] for matcher in MATCHERS}
        for seed in seeds:
            plan = plan_resampling(len(drive.query), profile, spacing=drive.spacing, seed=seed)
            matrix, truth = disturbed(scores, drive, plan)
            for matcher in MATCHERS:
                right[matcher].append(is_right(matrix, truth, matcher))
        joined = {matcher: np.concatenate(parts) for matcher, parts in right.items()}
        print(f"| {name}{settings} | {profile} | {cells(joined)} |", flush=True)
        yield profile, {matcher: float(values.mean()) for matcher, values in joined.items()}


def cells(right: dict[str, BoolArray]) -> str:
    """Return accuracies, then the paired differences of the best and of auto to the mean."""
    shares = {matcher: float(values.mean()) for matcher, values in right.items()}
    others = {matcher: share for matcher, share in shares.items() if matcher != "mean"}
    best = max(others, key=lambda matcher: others[matcher])
    shown = [str(len(right["mean"])), *(f"{share:.3f}" for share in shares.values())]
    return " | ".join([*shown, f"{best} {difference(right, best)}", difference(right, "auto")])


def difference(right: dict[str, BoolArray], matcher: str) -> str:
    """Return the paired difference to the mean with its interval."""
    gains = right[matcher].astype(float) - right["mean"]
    low, high = bootstrap_interval(gains, block_length=min(K, len(gains)))
    return f"{gains.mean():+.3f} ({low:+.3f} to {high:+.3f})"


if __name__ == "__main__":
    started = time.perf_counter()
    main()
    print(f"\nMade in {time.perf_counter() - started:.0f} s.")
