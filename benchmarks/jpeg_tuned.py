"""Print the thesis' chapter 5 on real drives: a network tuned for JPEG against others, as tables.

Run: .venv/bin/python benchmarks/jpeg_tuned.py [DATA_FOLDER [ROW=TECHNIQUE=WEIGHTS ...]]
Every further ROW is a network of one's own tuning, such as
"tuned by labels=efficientnet=labels/weights.safetensors"; {name} in a path is the drive's name.
JPEG_TUNED_DRIVE=corridor in the environment leaves the others out.
Accuracy of the windows answered at seven compressions (c = 0: pictures as they are; JPEG quality
100 - c, Pillow's defaults), query and map alike, then unlike; single frames and K = 5, 10; ±2
frames. Pictures are compressed at their own size, stromovka at 224 x 224 (as chapter 6 resizes).
Intervals: 95 %, bootstrap over blocks of 10 neighbouring windows, 2,000 draws, seed 0; the last
table has the paired difference of every tuned network and the untuned one it began as.
"""

import os
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from _real_sets import data_folder
from _worse_sets import (
    PictureSet,
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
from retraverse.images import Worsening, worsened
from retraverse.techniques import Descriptions, Technique

COMPRESSIONS = (0, 50, 80, 90, 95, 97, 99)
LENGTHS = (1, 5, 10)
UNLIKE = ((0, 97), (97, 0), (50, 97), (0, 99), (99, 0), (97, 99))
"""c of the query, c of the map."""
ROWS: dict[str, tuple[str, dict[str, Any]]] = {
    "tuned": ("efficientnet", {"weights": "jpeg"}),
    "untuned": ("efficientnet", {}),
    "HOG": ("hog", {}),
    "CoHOG": ("cohog", {"precision": "int8"}),
}
Side = Mapping[int, Descriptions]
Hits = dict[tuple[str, int, int, int], np.ndarray]
"""(technique, c of the query, c of the map, K) -> whether each window is right."""


def main() -> None:
    for pictures in picture_sets(data_folder()):
        if pictures.name not in os.environ.get("JPEG_TUNED_DRIVE", pictures.name):
            continue
        found: Hits = {}
        for label, (name, parameters) in rows().items():
            given = dict(parameters)
            if "weights" in given:
                given["weights"] = given["weights"].format(name=pictures.name)
            found |= hits_of(label, rt.technique(name, **given), pictures)
        print_alike(pictures, found)
        print_unlike(pictures, found)
        print_gain(pictures, found)


def rows() -> dict[str, tuple[str, dict[str, Any]]]:
    """Return what is compared; of networks that were given, the untuned ones too."""
    named = dict(ROWS)
    for given in sys.argv[2:]:
        label, name, weights = given.split("=")
        if name != "efficientnet":
            named[f"{name}, untuned"] = (name, {})
        named[label] = (name, {"weights": str(Path(weights).absolute())})
    return named


def untuned_of(label: str) -> str | None:
    """Return the row of the network that a tuned one began as."""
    name, parameters = rows()[label]
    if "weights" not in parameters:
        return None
    return next(row for row, what in rows().items() if what == (name, {}))


def hits_of(name: str, technique: Technique, pictures: PictureSet) -> Hits:
    """Return the hits of one technique at every pair of compressions that is shown."""
    queries = {c: compressed(pictures.query, c, technique) for c in COMPRESSIONS}
    references = {c: compressed(pictures.reference, c, technique) for c in COMPRESSIONS}
    found: Hits = {}
    for of_query, of_map in (*((c, c) for c in COMPRESSIONS), *UNLIKE):
        scores = technique.similarity(queries[of_query], references[of_map])
        for length in LENGTHS:
            found[name, of_query, of_map, length] = hits(scores, pictures.truth, length)
    return found


def compressed(images: Any, compression: int, technique: Technique) -> Descriptions:
    worsening = Worsening(compression=compression or None)
    return describe(worsened(as_traverse(images), worsening), technique)


def names(found: Hits) -> list[str]:
    return list(dict.fromkeys(name for name, *_ in found))


def print_alike(pictures: PictureSet, found: Hits) -> None:
    print(f"\n**{pictures.title}**, query and map compressed alike, {pictures.truth.description}\n")
    print_head("K", "technique", *(f"c = {c}" for c in COMPRESSIONS))
    for length in LENGTHS:
        for name in names(found):
            print_row(length, name, *(share(found[name, c, c, length]) for c in COMPRESSIONS))


def print_unlike(pictures: PictureSet, found: Hits) -> None:
    print(f"\n**{pictures.title}**, query and map compressed unlike\n")
    print_head("K", "technique", *(f"query {query}, map {map_}" for query, map_ in UNLIKE))
    for length in LENGTHS:
        for name in names(found):
            cells = (share(found[name, query, map_, length]) for query, map_ in UNLIKE)
            print_row(length, name, *cells)


def print_gain(pictures: PictureSet, found: Hits) -> None:
    print(f"\n**{pictures.title}**, paired difference to the untuned network\n")
    print_head("K", "technique", *(f"c = {c}" for c in COMPRESSIONS), "query 0, map 97")
    pairs = (*((c, c) for c in COMPRESSIONS), (0, 97))
    for length in LENGTHS:
        for name in names(found):
            untuned = untuned_of(name)
            if untuned is None:
                continue
            cells = [
                interval(found[name, query, map_, length] - found[untuned, query, map_, length])
                for query, map_ in pairs
            ]
            print_row(length, name, *cells)


if __name__ == "__main__":
    main()
