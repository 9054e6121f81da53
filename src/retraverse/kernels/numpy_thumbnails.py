"""NumPy twin of the compiled thumbnail differences, with the same sums.

It takes the same arguments and writes into the same array; they have been checked by
`retraverse.kernels.thumbnails`. One query at a time meets a few references: what stays in cache
is several times faster than one large temporary.
"""

import numpy as np
from numpy.typing import NDArray

from retraverse.types import ImageArray

__all__ = ["thumbnail_differences"]

TILE_BYTES = 256 * 1024


def thumbnail_differences(
    queries: ImageArray,
    references: ImageArray,
    out: NDArray[np.uint32],
    saturating: bool,
    threads: int,
    instruction_set: str,
) -> None:
    """Write the summed pixel difference of every pair into `out`, uint32 (Q, R)."""
    tile = max(1, TILE_BYTES // references.shape[1])
    for first in range(0, len(references), tile):
        some = references[first : first + tile]
        for row, query in enumerate(queries):
            apart = np.maximum(some, query) - (some if saturating else np.minimum(some, query))
            out[row, first : first + tile] = apart.sum(axis=1, dtype=np.uint32)
