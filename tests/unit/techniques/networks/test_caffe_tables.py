"""Our tables of layers against the published graphs, and against shapes the papers state."""

from collections.abc import Callable
from pathlib import Path

import pytest

from retraverse.errors import ConfigError
from retraverse.techniques.networks.caffe_tables import (
    ALEXNET,
    CAFFENET,
    CALC,
    SPED_NET,
    Layer,
    Shape,
    graph_of,
    output_shape,
    until,
)
from retraverse.weights.caffe_graph import CaffeLayer, read_prototxt

COLOUR, GREY = (3, 227, 227), (1, 120, 160)
NOT_IN_TABLES = {"Dropout", "Softmax", "Flatten"}
SETTINGS: dict[str, dict[str, object]] = {
    # Caffe's own defaults where a prototxt says nothing.
    "Convolution": {
        "num_output": None, "kernel_size": None, "stride": 1, "pad": 0, "group": 1
    },
    "InnerProduct": {"num_output": None},
    "LRN": {"local_size": 5, "alpha": 1.0, "beta": 0.75},
    "Pooling": {"pool": "MAX", "kernel_size": None, "stride": 1, "pad": 0},
    "ReLU": {"negative_slope": 0.0},
}  # fmt: skip
BLOCKS = {
    "Convolution": "convolution_param", "InnerProduct": "inner_product_param", "LRN": "lrn_param",
    "Pooling": "pooling_param", "ReLU": "relu_param",
}  # fmt: skip


def said(layer: CaffeLayer) -> tuple[object, ...]:
    """Return name, kind and every setting that changes what a layer does."""
    block = BLOCKS[layer.kind]
    values = {
        name: (layer.values(f"{block}.{name}") or (default,))[-1]
        for name, default in SETTINGS[layer.kind].items()
    }
    return layer.name, layer.kind, values


@pytest.mark.parametrize(
    ("file", "table", "shape"),
    [
        ("alexnet_vpr_deploy", ALEXNET, COLOUR),
        ("amosnet_deploy", SPED_NET, COLOUR),
        ("hybridnet_deploy", SPED_NET, COLOUR),
        ("regionvlad_deploy", CAFFENET, COLOUR),
        ("calc_deploy", CALC, GREY),
    ],
)
def test_the_tables_are_the_published_graphs(
    shared: Callable[[str], Path], file: str, table: tuple[Layer, ...], shape: Shape
) -> None:
    published = read_prototxt(shared(f"weights/prototxt/{file}.prototxt"))
    ours = graph_of(table, shape, "ours")
    layers = [layer for layer in published.layers if layer.kind not in NOT_IN_TABLES]
    assert [said(layer) for layer in ours.layers] == [said(layer) for layer in layers]
    assert [dims[1:] for dims in published.inputs.values()] == [shape]


@pytest.mark.parametrize(
    ("table", "last", "shape", "expected"),
    [
        # AlexNet, figure 2: 55, 27 and 13 a side, 96 to 384 maps, and 4096 units.
        (ALEXNET, "conv1", COLOUR, (96, 55, 55)),
        (ALEXNET, "pool1", COLOUR, (96, 27, 27)),
        (ALEXNET, "conv3", COLOUR, (384, 13, 13)),
        (ALEXNET, "pool5", COLOUR, (256, 6, 6)),
        (ALEXNET, "fc6", COLOUR, (4096, 1, 1)),
        (SPED_NET, "conv5", COLOUR, (256, 13, 13)),
        # CALC's descriptor has 1064 numbers, which pooling rounded down would not give.
        (CALC, "relu3", GREY, (4, 14, 19)),
    ],
)
def test_shapes(table: tuple[Layer, ...], last: str, shape: Shape, expected: Shape) -> None:
    assert output_shape(until(table, last), shape) == expected


def test_a_cut_names_the_layers_there_are() -> None:
    with pytest.raises(ConfigError, match="got 'conv9', expected one of conv1, relu1"):
        until(CALC, "conv9")


def test_relus_work_in_place() -> None:
    relu = graph_of(until(ALEXNET, "relu1"), COLOUR, "ours").layers[1]
    assert (relu.bottoms, relu.tops) == (("conv1",), ("conv1",))
