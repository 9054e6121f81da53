"""Print what each part of JPEG's damage costs each technique, as one table.

Run: .venv/bin/python benchmarks/jpeg_ablation.py [DATA_FOLDER] [C]
Query and map are made worse alike. Cells: change of accuracy against the clean pictures in
points (hundredths), with its 95 % interval (paired by window, circular blocks of 10 windows).
ConvSequential-SLAM with each frame's own region of interest scores like CoHOG on pictures in
memory, so the two share a column. Stromovka is resized to 224 px by OpenCV first.
"""

import sys
from collections.abc import Iterable
from typing import TypeVar

import numpy as np
from _real_sets import data_folder
from _worse_sets import BLOCK, TECHNIQUES, picture_sets, print_head, print_row

import retraverse as rt
from retraverse.metrics import bootstrap_interval
from retraverse.studies.measuring.jpeg_ablation import ABLATED_PARTS, AblationPoint, ablate

NAMES = ("CoHOG", "ORB", "HOG 256", "GIST 128", "patchnorm")
LENGTHS = (1, 10)
Item = TypeVar("Item")

Points = dict[tuple[str, int, str, str], AblationPoint]


def main() -> None:
    c = int(sys.argv[2]) if len(sys.argv) > 2 else 97
    print(f"c = {c}\n")
    print_head("part", "what is done")
    for part in ABLATED_PARTS:
        print_row(part.name, part.summary)
    print()
    print_head("set", "K", "part", *NAMES)
    points: Points = {}
    titles = []
    techniques = {name: rt.technique(TECHNIQUES[name][0], **TECHNIQUES[name][1]) for name in NAMES}
    for drives in picture_sets(data_folder()):
        titles.append(drives.title)
        found = ablate(
            drives.query,
            drives.reference,
            drives.truth,
            techniques,
            compression=c,
            sequence_lengths=LENGTHS,
            progress=tell,
        )
        for one in found:
            points[drives.title, one.sequence_length, one.part, one.technique] = one
        for length in LENGTHS:
            print_set(points, drives.title, length)
    for length in LENGTHS:
        print_pooled(points, titles, length)


def tell(items: Iterable[Item], *, total: int, label: str) -> Iterable[Item]:
    for number, item in enumerate(items):
        print(f"{label}: {number} of {total}", file=sys.stderr, flush=True)
        yield item


def print_set(points: Points, title: str, length: int) -> None:
    clean = [points[title, length, "clean", name].accuracy for name in NAMES]
    print_row(title, length, "clean (accuracy)", *(f"{accuracy:.3f}" for accuracy in clean))
    for part in ABLATED_PARTS[1:]:
        found = [points[title, length, part.name, name] for name in NAMES]
        cells = [cell(one.change, *one.interval) for one in found]
        print_row(title, length, part.name, *cells)


def print_pooled(points: Points, titles: list[str], length: int) -> None:
    """Print the changes over the windows of all sets together."""
    for part in ABLATED_PARTS[1:]:
        cells = []
        for name in NAMES:
            changes = np.concatenate(
                [
                    points[title, length, part.name, name].correct
                    - points[title, length, "clean", name].correct
                    for title in titles
                ]
            )
            cells.append(cell(changes.mean(), *bootstrap_interval(changes, block_length=BLOCK)))
        print_row("all", length, part.name, *cells)


def cell(change: float, low: float, high: float) -> str:
    return f"{100 * change:+.1f} [{100 * low:+.0f}, {100 * high:+.0f}]"


if __name__ == "__main__":
    main()
