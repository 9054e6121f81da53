"""Print accuracy and AUC of every technique on the real drives that are here, as a table.

Run: .venv/bin/python benchmarks/real_sets.py [DATA_FOLDER]
Tolerance ±2 frames; nordland_64x32 is thinned to every 20th file, winter queries on the summer
map, ±1 (±20 original files). gardens_point_thumbnails are 97x54 pictures cut from result sheets:
numbers on it are thumbnail numbers, never the published set's. Intervals: 95 %, bootstrap over
windows, seed 0.
"""

from typing import Any

from _real_sets import RealSet, data_folder, real_sets

import retraverse as rt
from retraverse.matching import describe_query

COLUMNS = (
    "technique", "parameters", "K", "answered", "accuracy", "95 %", "of all", "AUC", "AUC single",
)  # fmt: skip
RUNS: list[tuple[str, dict[str, Any], list[int | str]]] = [
    ("hog", {"form": "vprbench"}, [1, 10]),
    ("hog", {"form": "chapter6"}, [1, 10]),
    ("hog", {"form": "chapter7"}, [1, 10]),
    ("cohog", {}, [1, 10]),
    ("convsequential", {"roi": "first"}, [10, "dynamic"]),
    ("convsequential", {"roi": "each"}, [10, "dynamic"]),
    ("convsequential", {"roi": "first", "precision": "int8"}, [10, "dynamic"]),
]


def main() -> None:
    for drives in real_sets(data_folder()):
        print(
            f"\n**{drives.name}**: {len(drives.query)} queries, "
            f"{len(drives.reference)} references, {drives.truth.description}\n"
        )
        print(f"| {' | '.join(COLUMNS)} |\n|{'---|' * len(COLUMNS)}")
        for technique_name, parameters, lengths in RUNS:
            print_rows(drives, technique_name, parameters, lengths)


def print_rows(
    drives: RealSet,
    technique_name: str,
    parameters: dict[str, Any],
    lengths: list[int | str],
) -> None:
    """Print one row for each sequence length of one technique."""
    route = rt.build_map(drives.reference, rt.technique(technique_name, **parameters))
    queries = describe_query(drives.query, route)
    settings = ", ".join(f"{key}={value}" for key, value in parameters.items())
    for length in lengths:
        matches = rt.match(queries, route, sequence_length=length)  # type: ignore[arg-type]
        result = rt.evaluate(matches, drives.truth)
        low, high = result.accuracy_interval
        shown = (
            f"dynamic, mean {matches.sequence_length.mean():.1f}" if length == "dynamic" else length
        )
        print(
            f"| {technique_name} | {settings} | {shown} | {len(matches)} | {result.accuracy:.3f} | "
            f"{low:.3f}–{high:.3f} | {result.accuracy_all_queries:.3f} | {result.auc:.3f} | "
            f"{result.auc_single:.3f} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
