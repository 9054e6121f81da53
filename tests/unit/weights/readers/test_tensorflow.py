"""Frozen TensorFlow graphs: constants and nodes; OpenCV's importer reads the same ones."""

import json
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from tests.unit.weights.readers import samples
from tests.unit.weights.readers.samples import attribute, block, node, number

from retraverse.errors import InputError
from retraverse.weights.readers import read_weights
from retraverse.weights.readers.tensorflow import parse_frozen_graph, read_frozen_graph


def test_constants_and_nodes(tmp_path: Path) -> None:
    kernel = np.random.default_rng(0).standard_normal((3, 3, 2, 4)).astype(np.float32)
    path = samples.written(tmp_path, samples.frozen_graph({"w": kernel}))
    graph = read_frozen_graph(path)
    np.testing.assert_array_equal(graph.constants["w"], kernel)
    placeholder, conv = graph.nodes
    assert placeholder.attributes == {"dtype": 1}
    assert (conv.name, conv.kind, conv.inputs) == ("conv", "Conv2D", ("input", "w"))
    assert conv.attributes == {
        "strides": (1, 2, 2, 1),
        "padding": "SAME",
        "T": 1,
        "data_format": "NHWC",
    }
    listed = json.loads(read_weights(path).metadata["graph"])
    assert listed[1]["attributes"]["strides"] == [1, 2, 2, 1]
    # OpenCV's kernels are (out, in, height, width).
    opencvs = cv2.dnn.readNetFromTensorflow(str(path)).getParam("conv", 0)
    np.testing.assert_array_equal(opencvs, kernel.transpose(3, 2, 0, 1))


def constant(tensor: bytes) -> memoryview:
    return memoryview(node("c", "Const", (), attribute("value", block(8, tensor))))


def shape(*dims: int) -> bytes:
    return block(2, b"".join(block(2, number(1, dim)) for dim in dims))


FLOATS = np.array([1.5, -2], "<f4").tobytes()
TENSORS = {
    "packed floats": (number(1, 1) + shape(2) + block(5, FLOATS), [1.5, -2]),
    "floats one by one": (
        number(1, 1) + shape(2) + b"\x2d" + FLOATS[:4] + b"\x2d" + FLOATS[4:],
        [1.5, -2],
    ),
    "last one repeated": (number(1, 1) + shape(4) + block(5, FLOATS), [1.5, -2, -2, -2]),
    "zeros left out": (number(1, 3) + shape(3), [0, 0, 0]),
    "negative integer": (number(1, 3) + shape() + number(7, -5), -5),
    "int64": (number(1, 9) + shape(2) + number(10, 1 << 40) + number(10, -1), [1 << 40, -1]),
    "half": (number(1, 19) + shape(1) + number(13, 0x3E00), [1.5]),
    "bool": (number(1, 10) + shape(2) + block(11, b"\x01\x00"), [True, False]),
}


@pytest.mark.parametrize("case", TENSORS)
def test_every_way_to_write_a_tensor(case: str) -> None:
    content, expected = TENSORS[case]
    np.testing.assert_array_equal(parse_frozen_graph(constant(content)).constants["c"], expected)


def test_texts_are_left_out() -> None:
    numbers = constant(TENSORS["packed floats"][0])
    text = node("t", "Const", (), attribute("value", block(8, number(1, 7) + block(8, "hello"))))
    assert set(parse_frozen_graph(memoryview(bytes(numbers) + text)).constants) == {"c"}


def test_claimed_terabytes_are_refused(tmp_path: Path) -> None:
    content = bytes(constant(number(1, 1) + shape(1 << 20, 1 << 20) + block(5, FLOATS[:4])))
    with pytest.raises(InputError, match="more than so many bytes"):
        read_weights(samples.written(tmp_path, content))


def test_a_graph_that_was_not_frozen_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="frozen"):
        read_weights(samples.written(tmp_path, node("w", "VariableV2")))


def test_real_graph_nodes_fit_together(shared: Callable[[str], Path]) -> None:
    path = shared("weights/mobilenetv2_netvlad/modelarch_and_weights.2000.480x640x1.pb")
    graph = read_frozen_graph(path)
    names = {n.name for n in graph.nodes} | set(graph.constants)
    assert all(
        name.lstrip("^").partition(":")[0] in names for n in graph.nodes for name in n.inputs
    )
    assert graph.nodes[0].attributes["shape"] == (-1, 480, 640, 1)
