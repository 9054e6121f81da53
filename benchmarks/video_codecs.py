"""Print accuracy of query windows sent as H.265 or AV1 groups against JPEG files, at equal bytes.

Run: .venv/bin/python benchmarks/video_codecs.py [DATA_FOLDER]
A window of K query frames is one group of pictures, encoded on its own; the map's pictures are
clean. Windows do not overlap; the drive is cut twice, from frame 0 and from frame K // 2, so that
each K has about 2 Q / K windows. For each JPEG compression a codec takes about the finest quality
(one step coarser at most) whose windows weigh no more, on average, than the JPEG windows. A group
counts 12 bytes of our own framing and 3 a packet, JPEG files count none.
Corridor as it is, Stromovka 224 px, Gardens Point thumbnails 96 px (a group needs one size).
Intervals: 95 %, circular block bootstrap over windows, differences paired by window.
"""

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from _real_sets import data_folder
from _worse_sets import (
    TECHNIQUES,
    PictureSet,
    describe,
    hits,
    interval,
    picture_sets,
    print_head,
    print_row,
    share,
)

import retraverse as rt
from retraverse.images import Encoder, decode_bgr, encode_jpeg
from retraverse.images.bare_jpeg import TableSet, strip_tables
from retraverse.images.codecs import GROUP_CODECS, CodecName, decode_group, encode_group
from retraverse.techniques import Descriptions, Technique
from retraverse.types import ImageArray

LENGTHS = (5, 10)
COMPRESSIONS = (90, 97)
ENCODER = Encoder(optimize=True)
CODECS: tuple[CodecName, ...] = ("h265", "av1")
NAMES = ("HOG 256", "CoHOG")


@dataclass
class Sent:
    """Query windows as they arrive: pictures by (phase, frame), bytes of each window."""

    pictures: dict[int, list[ImageArray]]
    window_bytes: np.ndarray

    def correct(self, drives: "Drives", name: str, length: int) -> np.ndarray:
        parts = []
        for phase, pictures in self.pictures.items():
            starts = range(0, len(pictures), length)
            technique = drives.techniques[name]
            scores = np.zeros((len(drives.set.query), len(drives.set.reference)), np.float32)
            rows = technique.similarity(describe(pictures, technique), drives.references[name])
            scores[phase : phase + len(pictures)] = rows
            parts.append(hits(scores, drives.set.truth, length, [phase + s for s in starts]))
        return np.concatenate(parts)


@dataclass
class Drives:
    """One set with its map described."""

    set: PictureSet
    techniques: dict[str, Technique]
    groups: dict[tuple[int, str, int], Sent] = field(default_factory=dict)

    @cached_property
    def references(self) -> dict[str, Descriptions]:
        return {n: describe(self.set.reference, t) for n, t in self.techniques.items()}

    def windows(self, length: int) -> dict[int, list[list[ImageArray]]]:
        """Return the windows of both cuts, by the frame the cut begins at."""
        query = self.set.query
        return {
            phase: [
                list(query[start : start + length])
                for start in range(phase, len(query) - length + 1, length)
            ]
            for phase in (0, length // 2)
        }

    def as_group(self, length: int, codec: CodecName, quality: int) -> Sent:
        key = (length, codec, quality)
        if key not in self.groups:
            pictures: dict[int, list[ImageArray]] = {}
            sizes = []
            for phase, windows in self.windows(length).items():
                sent = [encode_group(window, codec, quality) for window in windows]
                sizes += list(map(len, sent))
                pictures[phase] = [one for group in sent for one in decode_group(group)]
            self.groups[key] = Sent(pictures, np.array(sizes))
        return self.groups[key]

    def as_jpeg(self, length: int, c: int) -> tuple[Sent, float]:
        """Return the windows as JPEG files, and their mean bytes without the constant tables."""
        known = TableSet.for_encoder(ENCODER, [c])
        pictures: dict[int, list[ImageArray]] = {}
        sizes, bare = [], []
        for phase, windows in self.windows(length).items():
            files = [[encode_jpeg(one, c, ENCODER) for one in window] for window in windows]
            sizes += [sum(map(len, window)) for window in files]
            bare += [sum(len(strip_tables(one, known)) for one in window) for window in files]
            pictures[phase] = [decode_bgr(one)[..., ::-1] for window in files for one in window]
        return Sent(pictures, np.array(sizes)), float(np.mean(bare))

    def at_most(self, length: int, codec: CodecName, n_bytes: float) -> tuple[int, Sent] | None:
        """Return the finest quality whose windows weigh no more than this, None if none does.

        Sought on every sixth window of the first cut, then made coarser until all windows fit.
        """
        low, high = 10, GROUP_CODECS[codec].worst
        some = self.windows(length)[0][::6]
        while low < high:
            middle = (low + high) // 2
            taken = np.mean([len(encode_group(window, codec, middle)) for window in some])
            low, high = (middle + 1, high) if taken > n_bytes else (low, middle)
        for quality in range(high, GROUP_CODECS[codec].worst + 1):
            sent = self.as_group(length, codec, quality)
            if sent.window_bytes.mean() <= n_bytes:
                return quality, sent
        return None


def main() -> None:
    for codec in CODECS:
        print(f"{codec}: {GROUP_CODECS[codec].label}")
    print(f"jpeg: {ENCODER.label}\n")
    techniques = {name: rt.technique(TECHNIQUES[name][0], **TECHNIQUES[name][1]) for name in NAMES}
    print_head(
        *("set", "K", "windows", "technique", "c", "JPEG bytes", "bare", "JPEG"),
        *(text for codec in CODECS for text in (f"{codec} crf, bytes", codec, "− JPEG")),
    )
    differences: dict[tuple[str, str, int], list[np.ndarray]] = {}
    for pictures in picture_sets(data_folder(), {"gardens_point_thumbnails": 96}):
        drives = Drives(pictures, techniques)
        for length in LENGTHS:
            print_set(drives, length, differences)
            drives.groups.clear()
    print("\nAll sets and compressions together (windows of all sets pooled, c averaged first):\n")
    print_head("technique", "K", "codec", "windows", "accuracy − JPEG's at equal bytes")
    for (name, codec, length), parts in differences.items():
        values = np.concatenate(parts)
        print_row(name, length, codec, len(values), interval(values))


def print_set(
    drives: Drives, length: int, differences: dict[tuple[str, str, int], list[np.ndarray]]
) -> None:
    per_codec: dict[tuple[str, str], list[np.ndarray]] = {}
    for c in COMPRESSIONS:
        jpeg, bare = drives.as_jpeg(length, c)
        chosen = {one: drives.at_most(length, one, jpeg.window_bytes.mean()) for one in CODECS}
        for name in NAMES:
            of_jpeg = jpeg.correct(drives, name, length)
            cells: list[str] = []
            for codec in CODECS:
                found = chosen[codec]
                if found is None:
                    cells += ["none so small", "", ""]
                    continue
                quality, sent = found
                correct = sent.correct(drives, name, length)
                per_codec.setdefault((name, codec), []).append(correct - of_jpeg)
                mean_bytes = f"{quality}, {sent.window_bytes.mean():.0f}"
                cells += [mean_bytes, f"{correct.mean():.3f}", interval(correct - of_jpeg)]
            print_row(
                *(drives.set.title, length, len(of_jpeg), name, c),
                *(f"{jpeg.window_bytes.mean():.0f}", f"{bare:.0f}", share(of_jpeg), *cells),
            )
    for (name, codec), values in per_codec.items():
        key = (name, codec, length)
        differences.setdefault(key, []).append(np.mean(values, axis=0))


if __name__ == "__main__":
    main()
