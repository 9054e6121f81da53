"""Print what a JPEG picture weighs without its constant tables, by set, compression and encoder.

Run: .venv/bin/python benchmarks/bare_jpeg.py [DATA_FOLDER]
Means over all query and reference pictures of a set. Bytes as they would be sent: a bare picture
counts its 9 bytes of key and size.
"""

import numpy as np
from _real_sets import data_folder, real_sets
from _worse_sets import RESIZE, SHORT, print_head, print_row

from retraverse.images import Encoder, Worsening, worsen_each
from retraverse.images.bare_jpeg import TableSet, restore_tables, strip_tables

COMPRESSIONS = (50, 80, 90, 95, 97, 99)
ENCODERS = (Encoder(), Encoder(optimize=True))


def main() -> None:
    print_head("set", "c", *(f"{e.label}{w}" for e in ENCODERS for w in ("", ", bare", ", saved")))
    for real in real_sets(data_folder()):
        if real.name not in RESIZE:
            continue
        rows: dict[int, list[list[int]]] = {c: [] for c in COMPRESSIONS}
        tables = [TableSet.for_encoder(encoder, COMPRESSIONS) for encoder in ENCODERS]
        for frame in (*real.query, *real.reference):
            sizes: dict[int, list[int]] = {c: [] for c in COMPRESSIONS}
            for encoder, known in zip(ENCODERS, tables, strict=True):
                ways = [Worsening(RESIZE[real.name], "opencv", c, encoder) for c in COMPRESSIONS]
                for way, made in zip(ways, worsen_each(frame, ways), strict=True):
                    jpeg = made.frame.encoded() or b""
                    bare = strip_tables(jpeg, known)
                    assert restore_tables(bare, known) == jpeg
                    assert way.compression is not None
                    sizes[way.compression] += [len(jpeg), len(bare)]
            for c in COMPRESSIONS:
                rows[c].append(sizes[c])
        for c in COMPRESSIONS:
            plain, plain_bare, small, small_bare = np.mean(rows[c], axis=0)
            print_row(
                SHORT.get(real.name, real.name),
                c,
                *(f"{plain:.0f}", f"{plain_bare:.0f}", f"{1 - plain_bare / plain:.0%}"),
                *(f"{small:.0f}", f"{small_bare:.0f}", f"{1 - small_bare / small:.0%}"),
            )


if __name__ == "__main__":
    main()
