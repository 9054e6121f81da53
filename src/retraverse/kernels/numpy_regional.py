"""NumPy twin of the compiled regional matching: the same call, for machines without a compiler.

Contents: `regional_scores`, with the arguments of the compiled function of that name; users call
`retraverse.kernels.regional_scores`, which checks them.
"""

import numpy as np

from retraverse.types import Array, FloatArray

__all__ = ["regional_scores"]

# Values in the largest product held at once: 16 MiB, which also stays in most last-level caches.
_BLOCK_VALUES = 1 << 22


def regional_scores(
    query: Array,
    references: Array,
    weights: FloatArray,
    out: FloatArray,
    threads: int,
    instruction_set: str,
) -> int:
    """Write scores into `out` (M, R); return -1, or the first reference that is not finite.

    `threads` and `instruction_set` are the compiled kernel's; here NumPy's own library decides.
    """
    used = weights.any(axis=0)
    query, weights = query[used].astype(np.float32, copy=False), weights[:, used]
    n_references, regions = references.shape[:2]
    # Products of bytes are exact in float32 as long as a sum stays below 2^24.
    unit = np.float32(255 * 255 if references.dtype == np.uint8 else 1)
    step = max(1, _BLOCK_VALUES // (regions * max(1, len(query))))
    for start in range(0, n_references, step):
        block = references[start : start + step].astype(np.float32, copy=False)
        finite = np.isfinite(block).all(axis=(1, 2))
        if not finite.all():
            return start + int(np.argmin(finite))
        out[:, start : start + step] = weights @ _best_matches(query, block) / unit
    return -1


def _best_matches(query: FloatArray, references: FloatArray) -> FloatArray:
    """Return the largest product of each query region with each reference's regions, (G, r)."""
    n_references, regions, length = references.shape
    flat = references.reshape(-1, length)
    best = np.empty((len(query), n_references), np.float32)
    step = max(1, _BLOCK_VALUES // len(flat))
    for start in range(0, len(query), step):
        products = query[start : start + step] @ flat.T
        best[start : start + step] = products.reshape(-1, n_references, regions).max(axis=2)
    return best
