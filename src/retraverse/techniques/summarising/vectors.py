"""Unit vectors and their cosine: what every technique with one vector a frame shares."""

import numpy as np

from retraverse.techniques.base import Descriptions
from retraverse.types import Array, FloatArray

__all__ = ["cosine_similarity", "unit_vector"]


def unit_vector(values: Array) -> FloatArray:
    """Return `values` flattened, as float32 of length 1; all zeros stay zeros.

    A zero vector says "no descriptor": its cosine with anything is 0.
    """
    flat = np.ascontiguousarray(values, dtype=np.float32).ravel()
    length = float(np.linalg.norm(flat))
    return flat if length == 0.0 else flat / np.float32(length)


def cosine_similarity(
    queries: Descriptions, references: Descriptions, *, non_negative: bool
) -> FloatArray:
    """Return the cosine of every pair of unit vectors, float32 (Q, R) (equation 4.1).

    Parameters
    ----------
    queries, references : Descriptions
        Of unit vectors, see `unit_vector`.
    non_negative : bool
        True for descriptors without negative values: rounding is then clipped to [0, 1];
        otherwise to [-1, 1].
    """
    scores: FloatArray = queries.descriptor @ references.descriptor.T
    return np.clip(scores, 0.0 if non_negative else -1.0, 1.0, out=scores)
