"""Print accuracy with quantisation tables tuned on the map alone against the standard's.

Run: .venv/bin/python benchmarks/quantisation.py [DATA_FOLDER]
Tables are tuned per technique, set and c by `retraverse.studies.measuring.quantisation` on the
reference drive; the query is then compressed with them, scaled by one factor so that its mean
bytes do not exceed those of the standard's tables at that c. The map is clean.
Encoder: pillow 4:2:0 optimize.
Intervals: 95 %, circular block bootstrap (10 windows), paired by window.
"""

import time
from dataclasses import replace

import numpy as np
from _real_sets import data_folder
from _worse_sets import (
    TECHNIQUES,
    as_traverse,
    describe,
    hits,
    interval,
    picture_sets,
    print_head,
    print_row,
    share,
)

import retraverse as rt
from retraverse.images import Encoder, QuantisationTables, Worsening, frame_bytes, worsened
from retraverse.images.quantisation import STANDARD_TABLES
from retraverse.studies.measuring.quantisation import TuningPlan, fit_bytes, tune_tables

COMPRESSIONS = (95,)
LENGTHS = (1, 10)
NAMES = ("HOG 256", "CoHOG", "patchnorm")
ENCODER = Encoder(optimize=True)


def main() -> None:
    print_head(
        *("set", "technique", "c", "bytes standard", "bytes tuned", "margin standard"),
        *("margin tuned", "K", "standard", "tuned", "tuned − standard", "tuning s"),
    )
    pooled: dict[tuple[str, int], list[np.ndarray]] = {}
    for drives in picture_sets(data_folder()):
        for name in NAMES:
            technique = rt.technique(TECHNIQUES[name][0], **TECHNIQUES[name][1])
            reference = as_traverse(drives.reference)
            clean = describe(reference, technique)
            for c in COMPRESSIONS:
                started = time.perf_counter()
                found = tune_tables(reference, technique, TuningPlan(compression=c))
                seconds = time.perf_counter() - started
                query = as_traverse(drives.query)
                standard = Worsening(compression=c, encoder=ENCODER)
                n_bytes = frame_bytes(worsened(query, standard)).mean()
                steps = np.array(found.tables.luminance + found.tables.chrominance, float)
                tables, tuned_bytes = fit_bytes(drives.query, steps, n_bytes, ENCODER)
                tuned = Worsening(compression=50, encoder=replace(ENCODER, tables=tables))
                scores = [
                    technique.similarity(describe(worsened(query, way), technique), clean)
                    for way in (standard, tuned)
                ]
                for length in LENGTHS:
                    one, other = (hits(matrix, drives.truth, length) for matrix in scores)
                    pooled.setdefault((name, length), []).append(other - one)
                    print_row(
                        *(drives.title, name, c, f"{n_bytes:.0f}", f"{tuned_bytes:.0f}"),
                        *(f"{found.margin_standard:.2f}", f"{found.margin:.2f}", length),
                        *(share(one), share(other), interval(other - one), f"{seconds:.0f}"),
                    )
                if drives.name == "stromovka" and c == 95:
                    print_steps(name, found.tables)
    print("\nAll sets and compressions:\n")
    print_head("technique", "K", "windows", "tuned − standard")
    for (name, length), parts in pooled.items():
        values = np.concatenate(parts)
        print_row(name, length, len(values), interval(values))


def print_steps(name: str, tables: QuantisationTables) -> None:
    standard = STANDARD_TABLES.at_quality(5)[0]
    for title, steps in ((f"standard c 95 {name}", standard), ("tuned", tables.luminance)):
        print(f"<!-- {title}: {np.array(steps).reshape(8, 8)[:4, :4].tolist()} -->")


if __name__ == "__main__":
    main()
