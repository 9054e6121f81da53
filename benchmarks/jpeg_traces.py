"""Print how many pictures `jpeg_traces` takes for strongly compressed, by how they were made.

Run: .venv/bin/python benchmarks/jpeg_traces.py [FOLDER_OF_PICTURES]
Every sixteenth picture of the folder (default: scikit-image's photographs), at three sizes, as it
is and through JPEG of quality 100 - c; then after moving and resizing, which lose the grid.
"""

import sys
import time
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np

from retraverse.images import STRONG_TRACES, jpeg_traces
from retraverse.training.pictures import load_pictures, seen_through_jpeg
from retraverse.types import ImageArray

SIZES = ((97, 54), (160, 120), (224, 224))
COMPRESSIONS = (None, 0, 25, 50, 75, 80, 85, 90, 95, 97, 99)
AFTERWARDS: dict[str, Callable[[ImageArray], ImageArray]] = {
    "moved by 3 pixels": lambda picture: picture[3:, 3:],
    "resized to 3/4": lambda picture: resized(picture, 0.75),
    "resized to 4/3": lambda picture: resized(picture, 4 / 3),
}


def main() -> None:
    pictures = photographs()
    print(f"{len(pictures)} pictures; share with traces of {STRONG_TRACES} or more\n")
    print("| pixels | " + " | ".join("as it is" if c is None else f"c = {c}" for c in COMPRESSIONS))
    print("|---" * (len(COMPRESSIONS) + 1) + "|")
    for size in SIZES:
        seen = [cv2.resize(picture, size, interpolation=cv2.INTER_AREA) for picture in pictures]
        cells = (share([seen_through_jpeg(one, c) for one in seen]) for c in COMPRESSIONS)
        print(f"| {size[0]} x {size[1]} | " + " | ".join(cells) + " |")
    compressed = [seen_through_jpeg(one, 97) for one in seen]
    print()
    for what, change in AFTERWARDS.items():
        print(f"c = 97 at {size[0]} x {size[1]}, {what}: {share(list(map(change, compressed)))}")
    print(f"one picture of {size[0]} x {size[1]}: {milliseconds(seen):.2f} ms")


def photographs() -> list[ImageArray]:
    if len(sys.argv) > 1:
        return load_pictures(Path(sys.argv[1]))[::16]
    from skimage import data

    return [data.astronaut(), data.chelsea(), data.coffee(), data.rocket()]


def resized(picture: ImageArray, scale: float) -> ImageArray:
    return np.asarray(cv2.resize(picture, None, fx=scale, fy=scale), np.uint8)


def share(pictures: list[ImageArray]) -> str:
    return f"{np.mean([jpeg_traces(picture) >= STRONG_TRACES for picture in pictures]):.3f}"


def milliseconds(pictures: list[ImageArray]) -> float:
    start = time.perf_counter()
    for picture in pictures:
        jpeg_traces(picture)
    return (time.perf_counter() - start) / len(pictures) * 1e3


if __name__ == "__main__":
    main()
