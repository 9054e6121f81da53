"""NumPy twin of the compiled keypoint matching, with the same counts.

It takes the same arguments and writes into the same array; they have been checked by
`retraverse.kernels.keypoints`. Bits as numbers of +1 and -1 make the distance a matrix product,
whose sums are whole numbers and therefore exact: <a, b> = 256 - 2 distance.
"""

import numpy as np
from numpy.typing import NDArray

from retraverse.types import FloatArray, ImageArray, IntArray

__all__ = ["keypoint_matches"]


def keypoint_matches(
    queries: ImageArray,
    query_counts: NDArray[np.int32],
    references: ImageArray,
    reference_counts: NDArray[np.int32],
    out: NDArray[np.int32],
    max_distance: int,
    threads: int,
    instruction_set: str,
) -> None:
    """Write the number of mutual nearest keypoints of every pair into `out`, int32 (Q, R)."""
    signs = [_signs(query[:count]) for query, count in zip(queries, query_counts, strict=True)]
    for column, (reference, count) in enumerate(zip(references, reference_counts, strict=True)):
        theirs = _signs(reference[:count]).T
        for row, ours in enumerate(signs):
            out[row, column] = _mutual(ours @ theirs, 256 - 2 * max_distance)


def _signs(descriptors: ImageArray) -> FloatArray:
    """Return float32 (n, 256): +1 where a bit is set, -1 where not."""
    return np.unpackbits(descriptors, axis=1).astype(np.float32) * 2 - 1


def _mutual(products: FloatArray, lowest: float) -> int:
    """Return how many rows and columns are each other's largest, and at least `lowest`."""
    if products.size == 0:
        return 0
    nearest: IntArray = products.argmax(axis=1)
    back = products.argmax(axis=0)[nearest]
    rows = np.arange(len(products))
    return int(np.count_nonzero((back == rows) & (products[rows, nearest] >= lowest)))
