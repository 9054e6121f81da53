"""Evidence: how far each pair stands out among the pairs of its query.

A row of similarities minus its mean, over its standard deviation. Whatever makes a whole picture
look more or less like everything (light, blur, a technique's own scale) falls out, so that rows
can be added up and compared with fixed thresholds; and it needs nothing but the row, so that it
is the same frame by frame.

An unmatched pair's evidence is roughly a standard normal number. The true pair's stands out by
some two of them for a technique worth using.
"""

import math

import numpy as np

from retraverse.types import Array, BoolArray, FloatArray, IntArray

__all__ = ["LARGEST", "along", "no_information", "standardise", "window_means"]

LARGEST = 5.0
"""Evidence is cut off here on both sides, so that no single frame decides: more than 5 standard
deviations say no more than "certainly"."""
FLAT = 1e-6
"""A row that nowhere differs from its mean by more than this, relatively, is constant up to
rounding."""
SMALLEST = 1e-37
"""Differences below this are lost in float32."""


def standardise(similarity: FloatArray) -> FloatArray:
    """Return the evidence of every pair, float32 of the same shape; 0 along constant rows."""
    evidence = np.empty(similarity.shape, np.float32)
    for row, out in zip(similarity, evidence, strict=True):
        mean = row.mean(dtype=np.float64)
        np.subtract(row, np.float32(mean), out=out)
        largest = float(np.abs(out).max())
        if largest <= FLAT * abs(mean) + SMALLEST:
            out[:] = 0
            continue
        out *= np.float32(1 / largest)  # squares of any scale of scores then fit
        out *= np.float32(1 / math.sqrt(np.square(out).mean(dtype=np.float64)))
        np.clip(out, -LARGEST, LARGEST, out=out)
    return evidence


def no_information(evidence: FloatArray) -> bool:
    """Return whether no row says anything."""
    return not evidence.any()


def window_means(values: Array, counted: BoolArray, sequence_length: int) -> FloatArray:
    """Return float32 (N,): mean of the counted values among each one and the K - 1 after it.

    0 where none is counted; windows are cut off at the end.
    """
    sums = _window_sums(np.where(counted, values, 0).astype(np.float64), sequence_length)
    counts = _window_sums(counted.astype(np.float64), sequence_length)
    return np.asarray(sums / np.maximum(counts, 1), np.float32)


def along(evidence: FloatArray, reference: IntArray) -> tuple[Array, BoolArray]:
    """Return the evidence of each query's reference, and whether it has one (-1 = none)."""
    known = reference >= 0
    values: Array = evidence[np.arange(len(reference)), np.maximum(reference, 0)]
    return values, known


def _window_sums(values: Array, length: int) -> Array:
    running = np.concatenate([[0.0], np.cumsum(values)])
    ends = np.minimum(np.arange(len(values)) + length, len(values))
    return np.asarray(running[ends] - running[:-1])
