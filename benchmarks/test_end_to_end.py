"""Files to matches: the whole of Corridor with dynamic windows, and the whole Nordland line.

Needs ../shared/data/corridor and nordland_64x32 (or RETRAVERSE_DATA). The limits are 8 s, for
int8 3 s, on two cores; the authors' program takes about 9 minutes for Corridor (not measured
here). The ratio is to the same job done pair by pair with NumPy's product and maximum, timed on
some of the frame pairs of the same run and scaled up.
"""

import os
import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import retraverse as rt
from retraverse.techniques import Descriptions

BASE = Path(os.environ.get("RETRAVERSE_DATA", Path(__file__).parents[2] / "shared" / "data"))
CORRIDOR = BASE / "corridor"
NORDLAND = BASE / "nordland_64x32"
needs_corridor = pytest.mark.skipif(not CORRIDOR.is_dir(), reason="data/corridor is not here")
needs_nordland = pytest.mark.skipif(not NORDLAND.is_dir(), reason="data/nordland_64x32 is not here")


def files_to_matches(precision: str) -> rt.Matches:
    technique = rt.technique("convsequential", precision=precision)
    route = rt.build_map(rt.open_traverse(CORRIDOR / "reference"), technique)
    query = rt.open_traverse(CORRIDOR / "query")
    return rt.match(query, route, sequence_length="dynamic")


def seconds_pair_by_pair() -> float:
    """Return the time of all 111 x 111 pairs by `dot` and `max`, from a tenth of them."""
    technique = rt.technique("convsequential")
    frames = rt.open_traverse(CORRIDOR / "query")[:12]
    described = Descriptions.stack(
        (technique.describe(technique.read(frame)) for frame in frames), technique.layout
    ).descriptor
    started = time.perf_counter()
    for query in described:
        for reference in described[:10]:
            np.dot(query, reference.T).max(axis=1).mean()
    return (time.perf_counter() - started) * 111 * 111 / (len(described) * 10)


@needs_corridor
@pytest.mark.parametrize(("precision", "limit_s"), [("float32", 8.0), ("int8", 3.0)])
def test_corridor_from_files_to_matches(benchmark: Any, precision: str, limit_s: float) -> None:
    matches = benchmark.pedantic(files_to_matches, args=(precision,), rounds=3, warmup_rounds=1)
    assert len(matches) == 97
    benchmark.extra_info["limit_s"] = limit_s
    benchmark.extra_info["pairwise NumPy, matching alone / ours, whole job"] = round(
        seconds_pair_by_pair() / benchmark.stats.stats.min, 1
    )
    benchmark.extra_info["share of the limit"] = round(benchmark.stats.stats.min / limit_s, 2)


def whole_line(name: str, parameters: dict[str, Any], matcher: str) -> rt.Matches:
    route = rt.build_map(rt.open_traverse(NORDLAND / "summer"), rt.technique(name, **parameters))
    query = rt.open_traverse(NORDLAND / "winter")
    return rt.match(query, route, sequence_length=10, matcher=matcher)


@needs_nordland
@pytest.mark.parametrize(
    ("name", "parameters", "matcher"),
    [("patchnorm", {}, "seqslam"), ("hog", {"form": "chapter7", "resolution": 64}, "mean")],
)
def test_whole_nordland_line(
    benchmark: Any, name: str, parameters: dict[str, Any], matcher: str
) -> None:
    arguments = (name, parameters, matcher)
    matches = benchmark.pedantic(whole_line, args=arguments, rounds=2)
    assert len(matches) > 3500
    benchmark.extra_info["share of the limit of 8 s"] = round(benchmark.stats.stats.min / 8, 2)
