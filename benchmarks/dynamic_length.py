"""Print dynamic sequence length, calibrated on the map, for every technique on the real drives.

Run: .venv/bin/python benchmarks/dynamic_length.py [DATA_FOLDER]

For each technique: its calibrated information threshold, how long its windows become, and its
accuracy beside fixed lengths (10, and the mean dynamic one). ``published`` is regional HOG under
the published 0.9. ``of all`` counts frames that got no answer as wrong; tolerances are in
_real_sets.py.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from _real_sets import RealSet, accuracy, data_folder, real_sets

import retraverse as rt
from retraverse import kernels
from retraverse.errors import InputError
from retraverse.matching import (
    GrowthRule,
    calibrate_growth,
    calibrated_windows,
    describe_entropy,
    describe_query,
    with_entropy,
)
from retraverse.matching.windows import match_diagonals

RUNS: dict[str, tuple[str, Mapping[str, Any], GrowthRule | None]] = {
    "hog": ("hog", {}, None),
    "gist": ("gist", {}, None),
    "orb": ("orb", {}, None),
    "patchnorm": ("patchnorm", {}, None),
    "sad": ("sad", {}, None),
    "regional HOG": ("cohog", {"grey": "decoder"}, None),
    "regional HOG, published": ("cohog", {"grey": "decoder"}, GrowthRule()),
}
EDGES = (1, 3, 6, 10, 15, 16, 26)
"""Histogram of K: 1-2, 3-5, 6-9, 10-14, 15, 16-25."""


def main() -> None:
    registered = {info.name for info in rt.techniques()}
    print("| drive | technique | IT | K: 1-2, 3-5, 6-9, 10-14, 15, 16-25 | mean K | answered | "
          "accuracy | of all | fixed K = mean | fixed K = 10 |")  # fmt: skip
    print("|---|---|---|---|---|---|---|---|---|---|")
    for real in real_sets(data_folder()):
        entropy = describe_entropy(real.query)
        for label, (name, parameters, rule) in RUNS.items():
            if name in registered:
                route = rt.build_map(real.reference, rt.technique(name, **parameters))
                try:
                    print_row(label, real, route, entropy, rule)
                except InputError as error:
                    print(f"| {real.name} | {label} | {error} ||||||||")


def print_row(
    label: str, real: RealSet, route: rt.RouteMap, entropy: Any, rule: GrowthRule | None
) -> None:
    queries = with_entropy(describe_query(real.query, route), entropy)
    growth = rule or calibrate_growth(route)
    windows = calibrated_windows(queries, route, rule=growth)
    lengths = np.array([window.length for window in windows])
    scores = rt.similarity(queries, route)
    reference, _ = match_diagonals([(0, scores)], lengths)
    right = real.truth.is_correct(np.arange(len(lengths)), reference)
    counts = np.histogram(lengths, EDGES)[0]
    mean_length = round(float(lengths.mean()))
    fixed = [accuracy(scores, real.truth, length) for length in (mean_length, 10)]
    print(
        f"| {real.name} | {label} | {growth.information_threshold:.3f} | "
        f"{', '.join(map(str, counts))} | {lengths.mean():.1f} | {len(lengths)} | "
        f"{right.mean():.3f} | {right.sum() / len(queries):.3f} | "
        f"{fixed[0]:.3f} (K = {mean_length}) | {fixed[1]:.3f} |",
        flush=True,
    )


if __name__ == "__main__":
    print(f"kernels: {kernels.backend()}\n")
    main()
