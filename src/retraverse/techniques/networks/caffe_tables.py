"""The networks of the Caffe years, layer by layer, and what shape comes out of each.

A table is a tuple of layers under the names they have in the published weights. Input shapes are
(channels, height, width). Nothing here needs PyTorch: `graph_of` makes of a table what
`caffe_net.CaffeNet` runs.

Conventions
- Pooling rounds up, as Caffe's does; convolutions round down.
- Caffe computes a ReLU in place, so its blob ``conv5`` holds what comes out of ``relu5``.

References
----------
Krizhevsky, Sutskever, Hinton: ImageNet Classification with Deep Convolutional Neural Networks,
NIPS 2012 (`ALEXNET`, as trained by Caffe's authors; `CAFFENET` pools before it normalises);
Chen, Jacobson, Sünderhauf, Upcroft, Liu, Shen, Reid, Milford: Deep Learning Features at Scale for
Visual Place Recognition, ICRA 2017 (`SPED_NET`); Merrill, Huang: Lightweight Unsupervised Deep
Loop Closure, RSS 2018 (`CALC`).
"""

from collections.abc import Mapping
from dataclasses import dataclass

from retraverse.errors import ConfigError
from retraverse.weights.caffe_graph import CaffeGraph, CaffeLayer, Scalar

__all__ = [
    "ALEXNET",
    "CAFFENET",
    "CALC",
    "SPED_NET",
    "Conv",
    "Dense",
    "Layer",
    "Lrn",
    "Pool",
    "Relu",
    "Shape",
    "graph_of",
    "output_shape",
    "until",
]

Shape = tuple[int, int, int]
"""Channels, height, width; a vector is (length, 1, 1)."""


@dataclass(frozen=True)
class Conv:
    """A convolution with bias."""

    name: str
    outputs: int
    kernel: int
    stride: int = 1
    padding: int = 0
    groups: int = 1


@dataclass(frozen=True)
class Relu:
    """Negative values become 0."""

    name: str


@dataclass(frozen=True)
class Lrn:
    """Local response normalisation across neighbouring channels, k = 1."""

    name: str
    size: int = 5
    alpha: float = 1e-4
    beta: float = 0.75


@dataclass(frozen=True)
class Pool:
    """Maximum over 3 x 3 every 2 pixels, rounded up."""

    name: str
    kernel: int = 3
    stride: int = 2


@dataclass(frozen=True)
class Dense:
    """A fully connected layer with bias; maps are flattened first."""

    name: str
    outputs: int


Layer = Conv | Relu | Lrn | Pool | Dense


def _first_layers(*, pool_first: bool) -> tuple[Layer, ...]:
    """Return conv1 to conv5 of AlexNet and its kin, each with its ReLU."""
    joints: list[tuple[Layer, ...]] = []
    for number in "12":
        pool, norm = Pool(f"pool{number}"), Lrn(f"norm{number}")
        joints.append((pool, norm) if pool_first else (norm, pool))
    return (
        Conv("conv1", 96, 11, stride=4), Relu("relu1"), *joints[0],
        Conv("conv2", 256, 5, padding=2, groups=2), Relu("relu2"), *joints[1],
        Conv("conv3", 384, 3, padding=1), Relu("relu3"),
        Conv("conv4", 384, 3, padding=1, groups=2), Relu("relu4"),
        Conv("conv5", 256, 3, padding=1, groups=2), Relu("relu5"),
    )  # fmt: skip


def _classifier(n_classes: int) -> tuple[Layer, ...]:
    return (
        Pool("pool5"), Dense("fc6", 4096), Relu("relu6"),
        Dense("fc7", 4096), Relu("relu7"), Dense("fc8", n_classes),
    )  # fmt: skip


ALEXNET: tuple[Layer, ...] = (*_first_layers(pool_first=False), *_classifier(1000))
"""AlexNet of Caffe's authors (``bvlc_alexnet``); input (3, 227, 227)."""

CAFFENET: tuple[Layer, ...] = (*_first_layers(pool_first=True), *_classifier(365))
"""AlexNet of Places365; input (3, 227, 227)."""

SPED_NET: tuple[Layer, ...] = (
    *_first_layers(pool_first=True),
    Conv("conv6", 256, 3, padding=1, groups=2), Relu("relu6"), Pool("pool6"),
    Dense("fc7_new", 4096), Relu("relu7"), Dense("fc8_new", 2543),
)  # fmt: skip
"""AMOSNet and HybridNet, which differ in their weights; input (3, 227, 227)."""

CALC: tuple[Layer, ...] = (
    Conv("conv1", 64, 5, stride=2, padding=4), Relu("relu1"), Pool("pool1"), Lrn("norm1"),
    Conv("conv2", 128, 4, padding=2), Relu("relu2"), Pool("pool2"), Lrn("norm2"),
    Conv("conv3", 4, 3), Relu("relu3"),
)  # fmt: skip
"""CALC's encoder; input (1, 120, 160), output (4, 14, 19)."""


def until(table: tuple[Layer, ...], last: str) -> tuple[Layer, ...]:
    """Return a table cut after the layer called `last`."""
    names = [layer.name for layer in table]
    if last not in names:
        raise ConfigError(f"layer: got {last!r}, expected one of {', '.join(names)}")
    return table[: names.index(last) + 1]


def output_shape(table: tuple[Layer, ...], shape: Shape) -> Shape:
    """Return the shape that comes out of a table for an input of `shape`."""
    for layer in table:
        shape = _shape_after(layer, shape)
    return shape


def _shape_after(layer: Layer, shape: Shape) -> Shape:
    channels, height, width = shape
    match layer:
        case Conv():
            grown = (height + 2 * layer.padding, width + 2 * layer.padding)
            height, width = ((side - layer.kernel) // layer.stride + 1 for side in grown)
            return layer.outputs, height, width
        case Pool():
            # -(-a // b) rounds up.
            height, width = (
                -(-(side - layer.kernel) // layer.stride) + 1 for side in (height, width)
            )
            return channels, height, width
        case Dense():
            return layer.outputs, 1, 1
        case _:
            return shape


def graph_of(table: tuple[Layer, ...], shape: Shape, name: str) -> CaffeGraph:
    """Return a table as a graph of Caffe layers; every ReLU works in place.

    Parameters
    ----------
    table : tuple of Layer
    shape : (channels, height, width)
        Of the pictures.
    name : str
        The network's, for messages.
    """
    layers, blob = [], "data"
    for layer in table:
        top = blob if isinstance(layer, Relu) else layer.name
        kind, settings = _caffe_settings(layer)
        parameters = {path: (value,) for path, value in settings.items()}
        layers.append(CaffeLayer(layer.name, kind, (blob,), (top,), parameters))
        blob = top
    return CaffeGraph(name, {"data": (1, *shape)}, tuple(layers))


def _caffe_settings(layer: Layer) -> tuple[str, Mapping[str, Scalar]]:
    """Return what Caffe calls a layer, and its settings as a prototxt has them."""
    match layer:
        case Conv():
            return "Convolution", {
                "convolution_param.num_output": layer.outputs,
                "convolution_param.kernel_size": layer.kernel,
                "convolution_param.stride": layer.stride,
                "convolution_param.pad": layer.padding,
                "convolution_param.group": layer.groups,
            }
        case Pool():
            return "Pooling", {
                "pooling_param.pool": "MAX",
                "pooling_param.kernel_size": layer.kernel,
                "pooling_param.stride": layer.stride,
            }
        case Lrn():
            return "LRN", {
                "lrn_param.local_size": layer.size,
                "lrn_param.alpha": layer.alpha,
                "lrn_param.beta": layer.beta,
            }
        case Dense():
            return "InnerProduct", {"inner_product_param.num_output": layer.outputs}
        case Relu():
            return "ReLU", {}
