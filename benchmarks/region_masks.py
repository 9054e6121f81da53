"""Print the accuracy of regional HOG with and without masks learned from the map, as a table.

Run: .venv/bin/python benchmarks/region_masks.py [DATA_FOLDER]

On every real drive that is here: no mask, then the least distinctive 5, 10, 25 and 50 % of the
regions masked, for single frames and windows of 10 (each frame by its own region of interest);
tolerances in _real_sets.py. The difference to no mask has its 95 % interval (paired bootstrap over
windows, 2,000 draws, seed 0). ``learned in`` is the time to learn a mask.
"""

import time

import numpy as np
from _real_sets import RealSet, data_folder, real_sets
from fusion import correct, paired_interval

import retraverse as rt
from retraverse.matching import describe_query, learn_region_mask, masked_map

QUANTILES = (0.0, 0.05, 0.1, 0.25, 0.5)
LENGTHS = (1, 10)


def main() -> None:
    print("| drive | masked | learned in | K = 1 | gain, 95 % | K = 10 | gain, 95 % |")
    print("|---|---|---|---|---|---|---|")
    for real in real_sets(data_folder()):
        print_rows(real)


def print_rows(real: RealSet) -> None:
    route = rt.build_map(real.reference, rt.technique("convsequential", roi="each"))
    queries = describe_query(real.query, route)
    plain = rt.similarity(queries, route)
    for quantile in QUANTILES:
        began = time.perf_counter()
        mask = learn_region_mask(route, quantile=quantile)
        learned_s = time.perf_counter() - began
        scores = rt.similarity(queries, masked_map(route, mask)) if quantile else plain
        cells = []
        for length in LENGTHS:
            right = correct(scores, real.truth, length)
            without = correct(plain, real.truth, length)
            low, high = paired_interval(right, without)
            gain = right.mean() - without.mean()
            cells += [f"{right.mean():.3f}", f"{gain:+.3f} ({low:+.3f} to {high:+.3f})"]
        share = np.mean(~mask.kept)
        print(
            f"| {real.name} | {share:.0%} | {learned_s:.1f} s | {' | '.join(cells)} |", flush=True
        )


if __name__ == "__main__":
    main()
