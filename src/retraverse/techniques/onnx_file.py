"""Any network in an ``.onnx`` file as a technique; its parameters say what goes in and out."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, Literal

import numpy as np

from retraverse.errors import ConfigError, DataMissingError, InputError
from retraverse.techniques.base import ArraySpec, Layout
from retraverse.techniques.parameters import check_range, parameter
from retraverse.techniques.preparing.network_input import channels_first, resized
from retraverse.techniques.preparing.published_input import resized_8_bit
from retraverse.techniques.registry import register
from retraverse.techniques.running.batching import Runner
from retraverse.techniques.running.extras import import_extra
from retraverse.techniques.running.learned import LearnedParameters, LearnedTechnique
from retraverse.techniques.summarising.pooling import flat, pool
from retraverse.types import Array, FloatArray, ImageArray

if TYPE_CHECKING:
    import torch

__all__ = ["OnnxFile", "OnnxFileParameters"]

_INPUT_TYPES = {
    "tensor(float)": np.float32,
    "tensor(float16)": np.float16,
    "tensor(double)": np.float64,
    "tensor(uint8)": np.uint8,
}
_RED_WEIGHT, _GREEN_WEIGHT, _BLUE_WEIGHT = 0.299, 0.587, 0.114


@dataclass(frozen=True)
class OnnxFileParameters(LearnedParameters):
    """The file, what its network takes, and what of its output is the descriptor."""

    weights: str = parameter("", "path of the .onnx file", compared=False)
    runtime: Literal["onnx"] = parameter("onnx", "what runs it: ONNX Runtime", compared=False)
    resolution: int = parameter(
        0, "side in pixels of the square picture, 8 to 4096; 0 = the size written in the graph"
    )
    resize: Literal["area", "bilinear", "bicubic"] = parameter(
        "bilinear", "area (OpenCV) or Pillow's bilinear or bicubic"
    )
    channels: Literal["rgb", "bgr", "grey"] = parameter("rgb", "which channels, in which order")
    axes: Literal["nchw", "nhwc"] = parameter("nchw", "order of the input's axes")
    scale: float = parameter(255.0, "what pixels 0..255 are divided by first; 1 leaves them")
    mean: str = parameter("0.485,0.456,0.406", "then taken off: one number, or one a channel")
    std: str = parameter("0.229,0.224,0.225", "then divided by: one number, or one a channel")
    output: str = parameter("", "name of the output to take; empty = the first")
    pooling: Literal[
        "flat", "mean", "gem", "grid2_max", "grid2_mean", "grid4_max", "grid4_mean"
    ] = parameter("flat", "how feature maps (N, C, H, W) become a vector; vectors stay (flat)")
    dimension: int = parameter(0, "length of the descriptor; 0 = as long as the graph makes it")

    def __post_init__(self) -> None:
        """Check ranges and lists of numbers."""
        super().__post_init__()
        check_range("onnx dimension", self.dimension, 0, 1 << 24)
        if self.resolution:
            check_range("onnx resolution", self.resolution, 8, 4096)
        if not self.scale > 0:
            raise ConfigError(f"onnx scale: got {self.scale:g}, expected more than 0")
        _numbers("mean", self.mean, self.n_channels)
        if not _numbers("std", self.std, self.n_channels).all():
            raise ConfigError(f"onnx std: got {self.std!r}, expected numbers other than 0")

    @property
    def n_channels(self) -> int:
        """1 for grey pictures, 3 for coloured ones."""
        return 1 if self.channels == "grey" else 3


@register(OnnxFileParameters)
class OnnxFile(LearnedTechnique):
    """A graph of yours, run by ONNX Runtime; one unit vector a picture, compared by the cosine.

    By default a picture is prepared as ImageNet's networks of PyTorch want it: RGB, 0..1, less the
    mean colour, by its deviation. The descriptor's length is what the graph gives. Maps made with
    it are refused for another file, by its content.
    """

    name: ClassVar[str] = "onnx"
    summary: ClassVar[str] = "any network in an .onnx file; say what it takes"
    citation: ClassVar[str] = "the network's own authors, whose file it is"
    version: ClassVar[int] = 1

    def __init__(self, parameters: OnnxFileParameters | None = None) -> None:
        super().__init__(parameters or OnnxFileParameters())
        if not self.parameters.dimension and Path(self.parameters.weights).expanduser().is_file():
            # A map records the length, and so can be opened where the file is not.
            self.parameters = replace(self.parameters, dimension=self._length())
        # Without length and file nothing can be described; one number stands for the unknown.
        shape = (self.parameters.dimension or 1,)
        self.layout = Layout("global", {"descriptor": ArraySpec(shape, "float32")})

    def _length(self) -> int:
        """Return how long the graph's vectors are: a picture of noise is run to see."""
        noise = np.random.default_rng(0).integers(0, 256, (64, 64, 3)).astype(np.uint8)
        return len(self.pool(self.runner()(self.prepare(noise)[None]))[0])

    def weights_path(self) -> Path:
        """Return the path of the graph.

        Raises
        ------
        DataMissingError
            If none is given, or there is no such file.
        """
        given = self.parameters.weights
        if not given:
            raise DataMissingError(
                "technique onnx: got no file; say which: weights=PATH.onnx "
                "(--set weights=PATH.onnx on the command line)"
            )
        path = Path(given).expanduser()
        if not path.is_file():
            raise DataMissingError(f"technique onnx: there is no file {given!r}")
        return path

    def build_network(self, tensors: Mapping[str, Array]) -> "torch.nn.Module":
        """Raise: a graph is no PyTorch module."""
        raise ConfigError("technique onnx: a graph runs in ONNX Runtime, not in PyTorch")

    def runner(self) -> "_Graph":
        """Return the graph, ready to run."""
        with self._lock:
            if self._runner is None:
                self._runner = _Graph(self.weights_path(), self.parameters)
            assert isinstance(self._runner, _Graph)
            return self._runner

    def prepare(self, image: ImageArray) -> FloatArray:
        """Return the picture as the parameters say, float32 (C, H, W)."""
        height, width = self._size()
        if self.parameters.resize == "area":
            small = resized(image, height, width)
        else:
            small = resized_8_bit(image, height, width, self.parameters.resize)
        picture = _in_order(small, self.parameters.channels).astype(np.float32)
        mean, std = (
            _numbers(name, getattr(self.parameters, name), self.parameters.n_channels)
            for name in ("mean", "std")
        )
        return channels_first((picture / np.float32(self.parameters.scale) - mean) / std)

    def pool(self, outputs: FloatArray) -> FloatArray:
        """Return the pooled vectors.

        Raises
        ------
        InputError
            If they are not as long as the parameters say.
        """
        how, expected = self.parameters.pooling, self.parameters.dimension
        vectors = flat(outputs) if how == "flat" else pool(outputs, how)
        if expected and vectors.shape[1] != expected:
            raise InputError(
                f"technique onnx: the graph gives {vectors.shape[1]} numbers, expected "
                f"dimension={expected}"
            )
        return vectors

    def _size(self) -> tuple[int, int]:
        side = self.parameters.resolution
        return (side, side) if side else self.runner().size


class _Graph(Runner):
    """A graph with one input for pictures, and one of its outputs."""

    def __init__(self, path: Path, parameters: OnnxFileParameters) -> None:
        runtime = import_extra("onnxruntime", "learned")
        options = runtime.SessionOptions()
        options.intra_op_num_threads = parameters.threads
        options.inter_op_num_threads = 1
        options.log_severity_level = 3
        # Threads that wait for work by spinning take the core from whoever decodes pictures.
        options.add_session_config_entry("session.intra_op.allow_spinning", "0")
        try:
            self._session = runtime.InferenceSession(
                str(path), options, providers=["CPUExecutionProvider"]
            )
        except Exception as error:  # ONNX Runtime's errors share no other class
            raise InputError(f"graph {path}: ONNX Runtime refuses it: {_line(error)}") from error
        self._path, self._axes = path, parameters.axes
        self._input = self._one_input()
        self._output = self._named_output(parameters.output)

    @property
    def size(self) -> tuple[int, int]:
        """Height and width that the graph says it takes.

        Raises
        ------
        InputError
            If it takes any.
        """
        shape = self._input.shape
        height, width = shape[2:4] if self._axes == "nchw" else shape[1:3]
        if not (isinstance(height, int) and isinstance(width, int)):
            raise InputError(
                f"graph {self._path}: takes pictures of any size {shape}; say resolution=…"
            )
        return height, width

    def __call__(self, pictures: FloatArray) -> FloatArray:
        """Return the output for float32 (N, C, H, W)."""
        fixed = self._input.shape[0]
        if fixed == 1 and len(pictures) > 1:
            return np.concatenate([self(pictures[i : i + 1]) for i in range(len(pictures))])
        fed = pictures if self._axes == "nchw" else pictures.transpose(0, 2, 3, 1)
        dtype = _INPUT_TYPES[self._input.type]
        try:
            outputs = self._session.run(
                [self._output], {self._input.name: np.ascontiguousarray(fed, dtype)}
            )
        except Exception as error:
            raise InputError(
                f"graph {self._path}: got pictures of shape {fed.shape}, expected "
                f"{self._input.shape}: {_line(error)}"
            ) from error
        return np.asarray(outputs[0], np.float32).reshape(len(pictures), *outputs[0].shape[1:])

    def _one_input(self) -> Any:
        inputs = self._session.get_inputs()
        if len(inputs) != 1 or len(inputs[0].shape) != 4 or inputs[0].type not in _INPUT_TYPES:
            told = [(each.name, each.type, each.shape) for each in inputs]
            raise InputError(
                f"graph {self._path}: its inputs are {told}, expected one of pictures, four axes"
            )
        return inputs[0]

    def _named_output(self, wanted: str) -> str:
        names = [str(output.name) for output in self._session.get_outputs()]
        if wanted and wanted not in names:
            raise ConfigError(
                f"onnx output: got {wanted!r}, expected one of {', '.join(names)} ({self._path})"
            )
        return wanted or names[0]


def _in_order(image: ImageArray, channels: str) -> Array:
    """Return (H, W, C) in the order asked for; grey by ITU-R BT.601."""
    if channels == "grey":
        weights = np.array([_RED_WEIGHT, _GREEN_WEIGHT, _BLUE_WEIGHT], np.float32)
        return np.round(image @ weights)[:, :, None]
    return image[:, :, ::-1] if channels == "bgr" else image


def _numbers(what: str, text: str, n_channels: int) -> FloatArray:
    """Return the numbers of ``"0.5"`` or ``"0.485,0.456,0.406"``, as many as channels.

    Grey pictures take the mean of three numbers: the defaults stay sensible.
    """
    try:
        values = np.array([float(part) for part in text.split(",")], np.float32)
    except ValueError:
        values = np.empty(0, np.float32)
    if len(values) not in (1, 3) or not np.isfinite(values).all():
        raise ConfigError(f"onnx {what}: got {text!r}, expected one number or three, with commas")
    return values if n_channels == 3 else values.mean(keepdims=True)


def _line(error: Exception) -> str:
    return " ".join(str(error).split())[:300]
