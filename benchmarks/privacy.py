"""Print, by resolution and compression, how large writing must be to be read, beside accuracy.

Run: .venv/bin/python benchmarks/privacy.py [DATA_FOLDER]
Legibility is a stand-in for privacy (retraverse.studies.measuring.legibility): characters drawn
into made-up scenes, read by a reader who knows font, place and size; smallest height read to 90 %,
in percent of the picture's side, and the distance at which the characters of a number plate
(75 mm) are so large for a camera of 60 degrees. Nothing is said about faces.
Accuracy: windows of 10, query and map both resized by Pillow to the square and compressed (pillow
4:2:0 optimize).
"""

import numpy as np
from _real_sets import RealSet, data_folder, real_sets
from _worse_sets import describe, hits, print_head, print_row, share

import retraverse as rt
from retraverse.images import Encoder, Worsening, worsened
from retraverse.studies.measuring.legibility import smallest_legible_height
from retraverse.techniques import Technique
from retraverse.types import FloatArray

SIDES = (16, 32, 64, 128, 256)
COMPRESSIONS = (None, 97)
PLATE_CHARACTER_M = 0.075
FIELD = np.deg2rad(60)
# The thumbnails of Gardens Point are smaller than most of the sides.
SETS = ("corridor", "stromovka")
NAMES = {
    "HOG (chapter 7)": ("hog", {"form": "chapter7"}),
    "CoHOG": ("cohog", {"precision": "int8"}),
}


def main() -> None:
    sets = [real for real in real_sets(data_folder()) if real.name in SETS]
    techniques = {
        name: rt.technique(technique, **parameters)
        for name, (technique, parameters) in NAMES.items()
    }
    columns = [f"{real.name}, {name}" for real in sets for name in NAMES]
    print_head("side px", "c", "smallest height %", "plate read to, m", *columns)
    for side in SIDES:
        for c in COMPRESSIONS:
            worsening = Worsening(side, "pillow", c, Encoder(optimize=True))
            height = smallest_legible_height(worsening)
            distance = PLATE_CHARACTER_M / (2 * np.tan(FIELD / 2) * height)
            cells = [
                share(hits(scores(real, technique, worsening), real.truth, 10))
                for real in sets
                for technique in techniques.values()
            ]
            shown = "–" if c is None else c
            print_row(side, shown, f"{100 * height:.1f}", f"{distance:.1f}", *cells)


def scores(real: RealSet, technique: Technique, worsening: Worsening) -> FloatArray:
    query, reference = (
        describe(worsened(drive, worsening), technique) for drive in (real.query, real.reference)
    )
    return technique.similarity(query, reference)


if __name__ == "__main__":
    main()
