"""Print the thesis' chapter 5 on real drives: a network tuned for JPEG against others, as tables.

Run: .venv/bin/python benchmarks/jpeg_tuned.py [DATA_FOLDER [WEIGHTS_TUNED_BY_LABELS]]
Accuracy of the windows answered at seven compressions (c = 0: pictures as they are; JPEG quality
100 - c, Pillow's defaults), query and map alike, then unlike; single frames and K = 5, 10; ±2
frames. Pictures are compressed at their own size, stromovka at 224 x 224 (as chapter 6 resizes).
Intervals: 95 %, bootstrap over blocks of 10 neighbouring windows, 2,000 draws, seed 0; the last
table has the paired difference of the tuned network and the untuned one.
"""

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
TUNED, BY_LABELS, UNTUNED = "tuned without labels", "tuned by labels", "untuned"
Side = Mapping[int, Descriptions]
Hits = dict[tuple[str, int, int, int], np.ndarray]
"""(technique, c of the query, c of the map, K) -> whether each window is right."""


def main() -> None:
    for pictures in picture_sets(data_folder()):
        found: Hits = {}
        for name, technique in techniques().items():
            found |= hits_of(name, technique, pictures)
        print_alike(pictures, found)
        print_unlike(pictures, found)
        print_gain(pictures, found)


def techniques() -> dict[str, Technique]:
    """Return what is compared; the network tuned by labels where its weights are given."""
    named: dict[str, tuple[str, dict[str, Any]]] = {TUNED: ("efficientnet", {"weights": "jpeg"})}
    if len(sys.argv) > 2:
        named[BY_LABELS] = ("efficientnet", {"weights": str(Path(sys.argv[2]).resolve())})
    named |= {UNTUNED: ("efficientnet", {}), "HOG": ("hog", {}), "CoHOG": ("cohog", {})}
    return {label: rt.technique(name, **values) for label, (name, values) in named.items()}


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
        for name in [name for name in names(found) if name in (TUNED, BY_LABELS)]:
            cells = []
            for query, map_ in pairs:
                untuned = found[UNTUNED, query, map_, length]
                cells.append(interval(found[name, query, map_, length] - untuned))
            print_row(length, name, *cells)


if __name__ == "__main__":
    main()
