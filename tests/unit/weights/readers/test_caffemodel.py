"""Caffe's weights: values against OpenCV's own importer, both layer formats, means."""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from tests.unit.weights.readers import samples
from tests.unit.weights.readers.samples import block, number

from retraverse.errors import InputError
from retraverse.weights.readers import read_weights

# det2's and det3's prototxt lie there under each other's name: OpenCV refuses them as they are.
REAL = {
    "mtcnn/det1.caffemodel": "mtcnn/det1.prototxt",
    "mtcnn/det2.caffemodel": "mtcnn/det3.prototxt",
    "mtcnn/det3.caffemodel": "mtcnn/det2.prototxt",
    "mtcnn/det4.caffemodel": "mtcnn/det4.prototxt",
    "squeezenet/squeezenet_v1.0.caffemodel": "squeezenet/SqueezeNet_deploy.prototxt",
}


@pytest.mark.parametrize("model", REAL)
def test_real_blobs_are_opencvs(model: str, shared: Callable[[str], Path]) -> None:
    path, graph = shared(f"weights/{model}"), shared(f"weights/{REAL[model]}")
    net = cv2.dnn.readNetFromCaffe(str(graph), str(path))
    tensors = read_weights(path).tensors
    assert len(tensors) >= 15
    for name, array in tensors.items():
        layer, _, i = name.rpartition(".")
        expected = net.getParam(layer, int(i))
        assert array.dtype == np.float32
        assert array.squeeze().shape == expected.squeeze().shape
        np.testing.assert_array_equal(array.ravel(), expected.ravel())


PROTOTXT = """
input: "data" input_dim: 1 input_dim: 3 input_dim: 6 input_dim: 6
layer { name: "conv1" type: "Convolution" bottom: "data" top: "conv1"
        convolution_param { num_output: 4 kernel_size: 3 } }
layer { name: "pool" type: "Pooling" bottom: "conv1" top: "pool"
        pooling_param { pool: MAX kernel_size: 2 stride: 2 } }
layer { name: "fc" type: "InnerProduct" bottom: "pool" top: "fc"
        inner_product_param { num_output: 5 } }
"""


@pytest.mark.parametrize("v1", [False, True])
@pytest.mark.parametrize("style", ["shape", "legacy", "unpacked"])
def test_every_style_is_read_as_opencv_reads_it(style: str, v1: bool, tmp_path: Path) -> None:
    written = samples.random_arrays()
    path = samples.written(tmp_path, samples.caffemodel(written, style, v1=v1))
    graph = samples.written(tmp_path, PROTOTXT.encode(), "net.prototxt")
    weights = read_weights(path)
    assert weights.metadata["name"] == "net"
    assert set(weights.tensors) == set(written)
    net = cv2.dnn.readNetFromCaffe(str(graph), str(path))
    for name, array in written.items():
        got = weights.tensors[name]
        expected_shape = (1,) * (4 - array.ndim) + array.shape if style == "legacy" else array.shape
        assert got.shape == expected_shape
        np.testing.assert_array_equal(got.ravel(), array.ravel())
        opencvs = net.getParam(name.rpartition(".")[0], int(name[-1]))
        np.testing.assert_array_equal(got.ravel(), opencvs.ravel())


def test_doubles_stay_doubles(tmp_path: Path) -> None:
    doubles = {"a.0": np.random.default_rng(1).standard_normal((2, 3))}
    tensors = read_weights(samples.written(tmp_path, samples.caffemodel(doubles))).tensors
    assert tensors["a.0"].dtype == np.float64
    np.testing.assert_array_equal(tensors["a.0"], doubles["a.0"])


@pytest.mark.parametrize("style", ["shape", "legacy"])
def test_mean_image(style: str, tmp_path: Path) -> None:
    mean = np.random.default_rng(2).standard_normal((1, 3, 5, 7)).astype(np.float32)
    weights = read_weights(samples.written(tmp_path, samples.blob(mean, style)))
    assert weights.metadata == {"kind": "binaryproto"}
    np.testing.assert_array_equal(weights.tensors["mean"], mean)


BLOB = samples.blob(np.ones((2, 2), np.float32))
DAMAGED = {
    "too few values": (
        block(1, "n") + block(100, block(7, block(7, block(1, b"\x02\x02")) + block(5, bytes(4)))),
        "has 1 values",
    ),
    "claimed terabytes": (
        block(1, "n") + block(100, block(1, "a") + block(7, number(1, 1 << 40) + block(5, b""))),
        "has 0 values",
    ),
    "one layer twice": (block(1, "n") + 2 * block(100, block(1, "a") + block(7, BLOB)), "twice"),
    "no blobs": (block(1, "n") + block(100, block(1, "a")), "no blobs"),
    "oldest format": (block(1, "n") + block(2, block(1, block(1, "a"))), "V0"),
    "length beyond the end": (b"\x0a\xff\xff\xff\xff\x0f" + b"name", "claims"),
    "endless number": (b"\x0a" + b"\xff" * 20, "more than ten bytes"),
    "group": (block(1, "n") + b"\x1b", "wire type 3"),
}


@pytest.mark.parametrize("case", DAMAGED)
def test_damage_is_named(case: str, tmp_path: Path) -> None:
    content, reason = DAMAGED[case]
    with pytest.raises(InputError, match=reason):
        read_weights(samples.written(tmp_path, content))
