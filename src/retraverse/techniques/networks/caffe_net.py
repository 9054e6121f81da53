"""Caffe networks run by torch: a graph from a prototxt, its weights from a caffemodel.

`CaffeNet` runs the layers that one blob needs and no others, so HybridNet's ``conv5`` needs no
fully connected weights. A blob's name means its value after the last layer that writes it: where
a ReLU works in place, as in AlexNet, ``conv5`` is the value after the ReLU, as users of pycaffe
read it from ``net.blobs``.
"""

import math
from collections.abc import Mapping

import numpy as np
import torch
from torch import Tensor, nn

from retraverse.errors import InputError
from retraverse.techniques.networks.caffe_layers import Built, build_layer
from retraverse.types import Array
from retraverse.weights.caffe_graph import CaffeGraph, CaffeLayer

__all__ = ["CaffeNet", "blob_shapes", "seeded_tensors"]


class CaffeNet(nn.Module):
    """A Caffe network up to one of its blobs.

    Parameters
    ----------
    graph : CaffeGraph
        From `retraverse.weights.caffe_graph.read_prototxt`; one input.
    tensors : mapping of str to array
        Blobs by name, ``"<layer>.<i>"``, as the caffemodel reader gives them. Those of layers
        that are not needed are not looked at.
    output : str, optional
        Name of the blob to return; default: what the last layer writes.

    Raises
    ------
    InputError
        If the graph cannot be run, or a blob is missing or has another size than the graph says.
    """

    def __init__(
        self, graph: CaffeGraph, tensors: Mapping[str, Array], output: str | None = None
    ) -> None:
        super().__init__()
        self.output = output or graph.layers[-1].tops[-1]
        self._layers = _needed(graph, self.output)
        self._input = _single_input(graph)
        built, self._shapes = _built(graph, self._layers)
        for layer, (module, blobs) in zip(self._layers, built, strict=True):
            _fill(module, layer.name, blobs, tensors)
        self.steps = nn.ModuleList(module for module, _ in built)
        self.eval()

    @property
    def input_shape(self) -> tuple[int, ...]:
        """Channels, height and width the graph names; other sizes run where it has no fc layer."""
        return self._shapes[self._input][1:]

    @property
    def output_shape(self) -> tuple[int, ...]:
        """Shape of the output of one picture of `input_shape`, without the axis of pictures."""
        return self._shapes[self.output][1:]

    def forward(self, pictures: Tensor) -> Tensor:
        """Return the output blob of pictures, shape (n, channels, height, width)."""
        blobs = {self._input: pictures}
        for layer, step in zip(self._layers, self.steps, strict=True):
            result = step(*(blobs[bottom] for bottom in layer.bottoms))
            blobs |= dict.fromkeys(layer.tops, result)
        return blobs[self.output]


def blob_shapes(graph: CaffeGraph, output: str | None = None) -> dict[str, tuple[int, ...]]:
    """Return name and shape of every blob of weights that `CaffeNet` looks for.

    Raises
    ------
    InputError
        If the graph cannot be run.
    """
    layers = _needed(graph, output or graph.layers[-1].tops[-1])
    built, _ = _built(graph, layers)
    return {
        f"{layer.name}.{i}": tuple(module.state_dict()[name].shape)
        for layer, (module, blobs) in zip(layers, built, strict=True)
        for i, name in enumerate(blobs)
    }


def seeded_tensors(graph: CaffeGraph, seed: int, output: str | None = None) -> dict[str, Array]:
    """Return random weights of the right shapes: for trying a network without its file.

    Scaled by the number of inputs (He et al., ICCV 2015, equation 10), so that values neither
    vanish nor grow from layer to layer.
    """
    random = np.random.default_rng(seed)
    return {name: _random_blob(random, shape) for name, shape in blob_shapes(graph, output).items()}


def _random_blob(random: np.random.Generator, shape: tuple[int, ...]) -> Array:
    if len(shape) < 2:
        # Biases, and BatchNorm's variances, which may not be negative.
        return random.uniform(0.05, 0.25, shape).astype(np.float32)
    deviation = math.sqrt(2 / math.prod(shape[1:]))
    return (random.standard_normal(shape) * deviation).astype(np.float32)


def _single_input(graph: CaffeGraph) -> str:
    if len(graph.inputs) != 1:
        raise InputError(f"net {graph.name!r} has inputs {sorted(graph.inputs)}, expected one")
    return next(iter(graph.inputs))


def _needed(graph: CaffeGraph, output: str) -> tuple[CaffeLayer, ...]:
    """Return the layers that the last value of blob `output` comes from, in running order."""
    wanted, layers = {output}, []
    for layer in reversed(graph.layers):
        if wanted & set(layer.tops):
            layers.append(layer)
            wanted = (wanted - set(layer.tops)) | set(layer.bottoms)
    if unknown := wanted - set(graph.inputs):
        known = sorted({top for layer in graph.layers for top in layer.tops})
        raise InputError(
            f"net {graph.name!r} has no blob {sorted(unknown)[0]!r}, expected one of {known}"
        )
    return tuple(reversed(layers))


def _built(
    graph: CaffeGraph, layers: tuple[CaffeLayer, ...]
) -> tuple[list[Built], dict[str, tuple[int, ...]]]:
    """Return modules without values, and every blob's shape for one picture."""
    shapes = {name: (1, *shape[1:]) for name, shape in graph.inputs.items()}
    built = []
    for layer in layers:
        inputs = [shapes[bottom] for bottom in layer.bottoms]
        try:
            built.append(build_layer(layer, inputs))
            result = built[-1].module(*(torch.empty(shape, device="meta") for shape in inputs))
        except (RuntimeError, IndexError, TypeError) as error:
            reason = str(error).partition("\n")[0]
            raise InputError(
                f"layer {layer.name!r} ({layer.kind}) cannot take {inputs}: {reason}"
            ) from error
        shapes |= dict.fromkeys(layer.tops, tuple(result.shape))
    return built, shapes


def _fill(
    module: nn.Module, layer: str, blobs: tuple[str, ...], tensors: Mapping[str, Array]
) -> None:
    state = {}
    for i, name in enumerate(blobs):
        expected = module.state_dict()[name].shape
        array = tensors.get(f"{layer}.{i}")
        if array is None:
            raise InputError(f"no blob {layer}.{i} among the weights, expected {tuple(expected)}")
        if not _fits(array.shape, tuple(expected)):
            raise InputError(
                f"blob {layer}.{i} has the shape {array.shape}, expected {tuple(expected)};"
                " are graph and weights of the same network?"
            )
        values = np.array(array, np.float32).reshape(tuple(expected))
        state[name] = torch.from_numpy(values)
    module.load_state_dict(state, assign=True)


def _fits(shape: tuple[int, ...], expected: tuple[int, ...]) -> bool:
    """Return whether shapes are the same but for axes of length 1, which old files add."""
    return [n for n in shape if n != 1] == [n for n in expected if n != 1]
