"""What every way of matching asks of its matrix and sequence length."""

import numpy as np

from retraverse.errors import ConfigError, InputError, ShapeError
from retraverse.types import FloatArray

__all__ = ["check_lengths_fit", "check_row", "check_sequence_length", "checked_similarity"]


def checked_similarity(similarity: FloatArray) -> FloatArray:
    """Return a similarity matrix as contiguous float32, or raise.

    Raises
    ------
    ShapeError
        If the matrix does not have two axes, or holds NaN or infinity.
    """
    scores = np.ascontiguousarray(similarity, dtype=np.float32)
    if scores.ndim != 2:
        raise ShapeError(f"similarity: got {scores.ndim} axes, expected 2: (queries, references)")
    if not np.isfinite(scores).all():
        row, column = np.argwhere(~np.isfinite(scores))[0]
        raise ShapeError(
            f"similarity: got {scores[row, column]} at query {row}, reference {column}; "
            "expected finite numbers"
        )
    return scores


def check_row(row: FloatArray, n_references: int) -> FloatArray:
    """Return one query's similarities as a float32 matrix of one row, or raise ShapeError."""
    scores = np.asarray(row)
    if scores.shape != (n_references,):
        raise ShapeError(
            f"row: got shape {scores.shape}, expected ({n_references},), one score per reference"
        )
    return checked_similarity(scores[None])


def check_sequence_length(sequence_length: object) -> None:
    """Raise `ConfigError` unless it is a whole number from 1 or "dynamic"."""
    whole = isinstance(sequence_length, (int, np.integer)) and not isinstance(sequence_length, bool)
    if sequence_length != "dynamic" and not (whole and sequence_length >= 1):  # type: ignore[operator]
        raise ConfigError(
            f"sequence_length: got {sequence_length!r}, expected a whole number from 1 or 'dynamic'"
        )


def check_lengths_fit(n_queries: int, n_references: int, sequence_length: int) -> None:
    """Raise unless both drives have at least one window of frames.

    Raises
    ------
    ConfigError
        If `sequence_length` is not a whole number from 1.
    InputError
        If a drive is shorter; the message says which.
    """
    check_sequence_length(sequence_length)
    for what, n_frames in (("query", n_queries), ("map", n_references)):
        if n_frames < sequence_length:
            raise InputError(
                f"sequence_length {sequence_length}: the {what} has only {n_frames} frames; "
                f"expected at least {sequence_length}, or a shorter sequence"
            )
