"""Caffe networks in torch, against OpenCV's own importer and executor."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from tests.unit.weights.readers import samples

from retraverse.errors import InputError
from retraverse.weights.caffe_graph import CaffeGraph, parse_prototxt, read_prototxt
from retraverse.weights.readers import read_weights

torch = pytest.importorskip("torch")
torch.set_num_threads(1)
from retraverse.techniques.networks.caffe_net import (  # noqa: E402
    CaffeNet,
    blob_shapes,
    seeded_tensors,
)

HEAD = 'name: "net" input: "data" input_dim: 1 input_dim: 4 input_dim: {h} input_dim: {w}\n'
CONV = (
    'layer {{ name: "{name}" type: "Convolution" bottom: "{bottom}" top: "{name}"'
    " convolution_param {{ {settings} }} }}\n"
)
POOL = (
    'layer {{ name: "out" type: "Pooling" bottom: "data" top: "out"'
    " pooling_param {{ {settings} }} }}"
)


def run(net: CaffeNet, pictures: np.ndarray) -> np.ndarray:
    with torch.inference_mode():
        return np.asarray(net(torch.from_numpy(pictures)).numpy())


def opencvs(
    folder: Path, text: str, tensors: samples.Arrays, pictures: np.ndarray, layer: str
) -> np.ndarray:
    graph = samples.written(folder, text.encode(), "net.prototxt")
    weights = samples.written(folder, samples.caffemodel(tensors), "net.caffemodel")
    net = cv2.dnn.readNetFromCaffe(str(graph), str(weights))
    net.setInput(pictures)
    return np.asarray(net.forward(layer))


def pictures_for(net: CaffeNet, seed: int = 0) -> np.ndarray:
    random = np.random.default_rng(seed)
    return random.uniform(-1, 1, (1, *net.input_shape)).astype(np.float32)


def assert_close(got: np.ndarray, expected: np.ndarray, relative: float = 1e-4) -> None:
    assert got.size == expected.size
    largest = np.abs(expected).max()
    assert largest > 0
    assert np.abs(got.ravel() - expected.ravel()).max() <= relative * largest


# Blobs by Caffe's names, and the layer whose output OpenCV calls the same: it gives the value
# before an in-place ReLU under the blob's name.
GRAPHS = {
    ("calc_deploy", "descriptor"): "descriptor",
    ("calc_deploy", "norm1"): "norm1",
    ("hybridnet_deploy", "norm1"): "norm1",
    ("hybridnet_deploy", "conv5"): "relu5",
    ("hybridnet_deploy", "conv6"): "relu6",
    ("regionvlad_deploy", "conv3"): "relu3",
    ("alexnet_vpr_deploy", "conv3"): "relu3",
}


@pytest.mark.parametrize(("name", "blob"), GRAPHS)
def test_seeded_graphs_agree_with_opencv(
    name: str, blob: str, shared: Callable[[str], Path], tmp_path: Path
) -> None:
    path = shared(f"weights/prototxt/{name}.prototxt")
    graph = read_prototxt(path)
    tensors = seeded_tensors(graph, 1, blob)
    net = CaffeNet(graph, tensors, blob)
    pictures = pictures_for(net)
    # OpenCV wants every layer's weights: the graph is cut behind the one that is compared.
    text = path.read_text()
    end = (
        text.index("layer", text.index(f'name: "{GRAPHS[name, blob]}"'))
        if blob != "descriptor"
        else None
    )
    expected = opencvs(tmp_path, text[:end], tensors, pictures, GRAPHS[name, blob])
    assert_close(run(net, pictures), expected)


def test_calc_has_1064_numbers(shared: Callable[[str], Path]) -> None:
    graph = read_prototxt(shared("weights/prototxt/calc_deploy.prototxt"))
    assert CaffeNet(graph, seeded_tensors(graph, 0)).output_shape == (1064,)
    assert CaffeNet(graph, seeded_tensors(graph, 0), "relu3").output_shape == (4, 14, 19)


REAL = {
    "squeezenet/squeezenet_v1.0.caffemodel": "squeezenet/SqueezeNet_deploy.prototxt",
    "mtcnn/det1.caffemodel": "mtcnn/det1.prototxt",
    "mtcnn/det2.caffemodel": "mtcnn/det3.prototxt",
    "mtcnn/det3.caffemodel": "mtcnn/det2.prototxt",
}


@pytest.mark.parametrize("model", REAL)
def test_real_networks_agree_with_opencv(model: str, shared: Callable[[str], Path]) -> None:
    weights, graph = shared(f"weights/{model}"), shared(f"weights/{REAL[model]}")
    net = CaffeNet(read_prototxt(graph), read_weights(weights).tensors)
    reference = cv2.dnn.readNetFromCaffe(str(graph), str(weights))
    pictures = pictures_for(net)
    reference.setInput(pictures)
    assert_close(run(net, pictures), reference.forward(net.output))


LAYERS = {
    "groups": CONV.format(
        name="out", bottom="data", settings="num_output: 6 group: 2 kernel_size: 3 pad: 1"
    ),
    "dilation": CONV.format(
        name="out", bottom="data", settings="num_output: 2 kernel_size: 3 dilation: 2"
    ),
    "sides": CONV.format(
        name="out",
        bottom="data",
        settings="num_output: 2 kernel_h: 3 kernel_w: 2 stride_h: 2 stride_w: 1 pad_h: 1 pad_w: 0",
    ),
    "no bias": CONV.format(
        name="out", bottom="data", settings="num_output: 2 kernel_size: 1 bias_term: false"
    ),
    "fc": 'layer { name: "out" type: "InnerProduct" bottom: "data" top: "out"'
    " inner_product_param { num_output: 7 } }",
    "lrn": 'layer { name: "out" type: "LRN" bottom: "data" top: "out"'
    " lrn_param { local_size: 3 alpha: 0.5 beta: 0.75 } }",
    "lrn within": 'layer { name: "out" type: "LRN" bottom: "data" top: "out"'
    " lrn_param { local_size: 3 alpha: 0.5 beta: 0.75 norm_region: WITHIN_CHANNEL } }",
    "prelu": 'layer { name: "out" type: "PReLU" bottom: "data" top: "out" }',
    "slope": 'layer { name: "out" type: "ReLU" bottom: "data" top: "out"'
    " relu_param { negative_slope: 0.1 } }",
    "sigmoid": 'layer { name: "out" type: "Sigmoid" bottom: "data" top: "out" }',
    "tanh": 'layer { name: "out" type: "TanH" bottom: "data" top: "out" }',
    "softmax": 'layer { name: "out" type: "Softmax" bottom: "data" top: "out" }',
    "flatten": 'layer { name: "out" type: "Flatten" bottom: "data" top: "out" }',
    "power": 'layer { name: "out" type: "Power" bottom: "data" top: "out"'
    " power_param { power: 2 scale: 3 shift: 1 } }",
    "batch norm": 'layer { name: "out" type: "BatchNorm" bottom: "data" top: "out"'
    " batch_norm_param { eps: 0.001 } }",
    "scale": 'layer { name: "out" type: "Scale" bottom: "data" top: "out"'
    " scale_param { bias_term: true } }",
    "dropout": 'layer { name: "out" type: "Dropout" bottom: "data" top: "out" }',
    "concat": 'layer { name: "a" type: "Sigmoid" bottom: "data" top: "a" }'
    'layer { name: "out" type: "Concat" bottom: "data" bottom: "a" top: "out" }',
    "sum": 'layer { name: "a" type: "Sigmoid" bottom: "data" top: "a" }'
    'layer { name: "out" type: "Eltwise" bottom: "data" bottom: "a" top: "out"'
    " eltwise_param { operation: SUM coeff: 2 coeff: -1 } }",
    "product": 'layer { name: "a" type: "Sigmoid" bottom: "data" top: "a" }'
    'layer { name: "out" type: "Eltwise" bottom: "data" bottom: "a" top: "out"'
    " eltwise_param { operation: PROD } }",
    "maximum": 'layer { name: "a" type: "Sigmoid" bottom: "data" top: "a" }'
    'layer { name: "out" type: "Eltwise" bottom: "data" bottom: "a" top: "out"'
    " eltwise_param { operation: MAX } }",
    "global mean": 'layer { name: "out" type: "Pooling" bottom: "data" top: "out"'
    " pooling_param { pool: AVE global_pooling: true } }",
}


@pytest.mark.parametrize("kind", LAYERS)
def test_layer_agrees_with_opencv(kind: str, tmp_path: Path) -> None:
    text = HEAD.format(h=7, w=9) + LAYERS[kind]
    graph = parse_prototxt(text)
    tensors = seeded_tensors(graph, 2)
    if kind == "batch norm":
        tensors["out.2"] = np.array([4], np.float32)
    net = CaffeNet(graph, tensors)
    pictures = pictures_for(net)
    expected = opencvs(tmp_path, text, tensors, pictures, "out")
    got = run(net, pictures)
    assert got.shape[1:] == net.output_shape
    assert_close(got, expected, 1e-5)


def caffes_pooling(
    values: np.ndarray, method: str, window: int, stride: int, pad: int
) -> np.ndarray:
    """Pool as Caffe's documentation says, window by window."""
    height, width = values.shape

    def count(side: int) -> int:
        pooled = -(-(side + 2 * pad - window) // stride) + 1
        return pooled - 1 if pad and (pooled - 1) * stride >= side + pad else pooled

    out = np.empty((count(height), count(width)), np.float32)
    for row, column in np.ndindex(*out.shape):
        top, left = row * stride - pad, column * stride - pad
        bottom, right = min(top + window, height + pad), min(left + window, width + pad)
        area = (bottom - top) * (right - left)
        inside = values[max(top, 0) : min(bottom, height), max(left, 0) : min(right, width)]
        out[row, column] = inside.max() if method == "MAX" else inside.sum() / area
    return out


@pytest.mark.parametrize("method", ["MAX", "AVE"])
@pytest.mark.parametrize(
    ("window", "stride", "pad"), [(3, 2, 0), (3, 2, 1), (2, 2, 1), (2, 1, 0), (3, 3, 1), (5, 2, 2)]
)
@pytest.mark.parametrize("sides", [(7, 9), (8, 6), (5, 12)])
def test_pooling_is_caffes(
    method: str, window: int, stride: int, pad: int, sides: tuple[int, int]
) -> None:
    settings = f"pool: {method} kernel_size: {window} stride: {stride} pad: {pad}"
    text = HEAD.format(h=sides[0], w=sides[1]) + POOL.format(settings=settings)
    net = CaffeNet(parse_prototxt(text), {})
    pictures = pictures_for(net)
    got = run(net, pictures)
    for channel in range(4):
        expected = caffes_pooling(pictures[0, channel], method, window, stride, pad)
        np.testing.assert_allclose(got[0, channel], expected, rtol=1e-5, atol=1e-6)


def small() -> CaffeGraph:
    conv = CONV.format(name="conv", bottom="data", settings="num_output: 2 kernel_size: 3")
    rest = (
        'layer { name: "relu" type: "ReLU" bottom: "conv" top: "conv" }'
        'layer { name: "fc" type: "InnerProduct" bottom: "conv" top: "fc"'
        " inner_product_param { num_output: 3 } }"
    )
    return parse_prototxt(HEAD.format(h=5, w=6) + conv + rest)


def test_a_blob_is_what_the_last_layer_wrote_in_place() -> None:
    graph = small()
    net = CaffeNet(graph, seeded_tensors(graph, 0, "conv"), "conv")
    pictures = pictures_for(net)
    before = pictures.copy()
    assert run(net, pictures).min() == 0
    np.testing.assert_array_equal(pictures, before)


def test_only_what_a_blob_needs_is_asked_for() -> None:
    assert blob_shapes(small(), "conv") == {"conv.0": (2, 4, 3, 3), "conv.1": (2,)}
    assert blob_shapes(small())["fc.0"] == (3, 2 * 3 * 4)


def test_seeds_repeat_and_differ() -> None:
    first, again, other = (seeded_tensors(small(), seed) for seed in (5, 5, 6))
    np.testing.assert_array_equal(first["fc.0"], again["fc.0"])
    assert not np.array_equal(first["fc.0"], other["fc.0"])


def test_old_shapes_with_four_axes_fit() -> None:
    graph = small()
    tensors = seeded_tensors(graph, 0)
    old = {name: a.reshape((1,) * (4 - a.ndim) + a.shape) for name, a in tensors.items()}
    pictures = pictures_for(CaffeNet(graph, tensors))
    np.testing.assert_array_equal(
        run(CaffeNet(graph, old), pictures), run(CaffeNet(graph, tensors), pictures)
    )


def test_weights_of_another_network_are_refused() -> None:
    tensors: dict[str, Any] = dict(seeded_tensors(small(), 0))
    with pytest.raises(InputError, match=r"fc\.0 has the shape \(3, 25\), expected \(3, 24\)"):
        CaffeNet(small(), tensors | {"fc.0": np.ones((3, 25), np.float32)})
    del tensors["fc.1"]
    with pytest.raises(InputError, match=r"no blob fc\.1"):
        CaffeNet(small(), tensors)


WRONG = {
    "unknown kind": ('layer { name: "x" type: "Crop" bottom: "data" top: "x" }', "'Crop'"),
    "unknown blob": ('layer { name: "x" type: "ReLU" bottom: "nowhere" top: "x" }', "no blob"),
    "too small": (
        CONV.format(name="x", bottom="data", settings="num_output: 1 kernel_size: 9"),
        "cannot take",
    ),
    "no kernel": (CONV.format(name="x", bottom="data", settings="num_output: 1"), "kernel_size"),
    "no outputs": (CONV.format(name="x", bottom="data", settings="kernel_size: 1"), "num_output"),
    "groups": (
        CONV.format(name="x", bottom="data", settings="num_output: 3 group: 3 kernel_size: 1"),
        "3 groups",
    ),
    "no bottom": ('layer { name: "x" type: "ReLU" top: "x" }', "reads no blob"),
    "pooling": (
        'layer { name: "x" type: "Pooling" bottom: "data" top: "x"'
        " pooling_param { pool: STOCHASTIC kernel_size: 2 } }",
        "STOCHASTIC",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_graphs_that_cannot_run_are_refused(case: str) -> None:
    text, reason = WRONG[case]
    with pytest.raises(InputError, match=reason):
        blob_shapes(parse_prototxt(HEAD.format(h=5, w=5) + text))


def test_unknown_output_lists_the_blobs() -> None:
    with pytest.raises(InputError, match=r"expected one of \['conv', 'fc'\]"):
        CaffeNet(small(), {}, "conv7")
