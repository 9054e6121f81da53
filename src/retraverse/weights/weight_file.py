"""What every reader of foreign weight files gives back: named arrays, and nothing that runs."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from retraverse.types import Array

__all__ = ["WeightFile"]


@dataclass(frozen=True)
class WeightFile:
    """The arrays of one weight file under the names they have in it.

    Read-only by convention: several techniques may share one.
    """

    tensors: Mapping[str, Array] = field(repr=False)
    """Name -> array, in the file's order, names and axes as in the file. Caffe's blobs have no
    names of their own: they are ``"<layer>.<i>"``, i = 0 the weight, 1 the bias. Quantised and
    bit-packed values come as float32."""
    metadata: Mapping[str, str]
    """What else the file says about itself, as text: fit for the header of a safetensors file.
    Graphs (``"graph"``) are JSON."""
    format: str
    """``caffemodel``, ``keras``, ``matlab``, ``npz``, ``onnx``, ``pickle``, ``safetensors``,
    ``tensorflow``, ``tflite`` or ``torch``."""
