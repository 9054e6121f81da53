"""TensorFlow Lite files: dequantised and unpacked constants, operators and their options."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from tests.unit.weights.readers import samples

from retraverse.errors import InputError
from retraverse.weights.readers import read_weights
from retraverse.weights.readers.flatbuffers import read_flex_map
from retraverse.weights.readers.tflite import parse_tflite, read_tflite


def test_quantised_kernel_is_scaled_channel_by_channel() -> None:
    model = parse_tflite(memoryview(samples.tflite(seed=3)))
    stored = np.random.default_rng(3).integers(-128, 128, (4, 3, 3, 2), np.int8)
    for channel, (scale, zero) in enumerate([(0.5, 0), (0.25, 0), (2, 3), (1, 0)]):
        expected = (stored[channel].astype(np.float32) - zero) * np.float32(scale)
        np.testing.assert_array_equal(model.tensors["kernel"][channel], expected)
    assert model.tensors["kernel"].dtype == np.float32
    np.testing.assert_array_equal(model.tensors["bias"], [0, 1, 2, 3])


def test_operators_have_names_and_options() -> None:
    model = parse_tflite(memoryview(samples.tflite(np.ones((2, 1, 1, 40)))))
    conv, binary = model.operators
    assert (conv.kind, conv.inputs, conv.outputs) == (
        "conv_2d",
        ("input", "kernel", "bias"),
        ("output",),
    )
    assert conv.options == {
        "padding": "same",
        "stride_width": 2,
        "stride_height": 2,
        "fused_activation_function": "relu",
        "dilation_width_factor": 1,
        "dilation_height_factor": 1,
    }
    assert (binary.kind, binary.inputs) == ("LceBconv2d", ("output", "binary", ""))
    assert binary.options == {"channels_in": 40, "padding": "same", "stride_width": 1}
    assert (model.inputs, model.outputs) == (("input",), ("last",))
    assert model.shapes["input"] == (1, 8, 8, 2)


@pytest.mark.parametrize("channels", [1, 31, 32, 33, 96])
def test_binary_kernel_is_unpacked(channels: int) -> None:
    random = np.random.default_rng(channels)
    kernel = random.choice(np.array([-1, 1], np.float32), (3, 2, 2, channels))
    model = parse_tflite(memoryview(samples.tflite(kernel)))
    np.testing.assert_array_equal(model.tensors["binary"], kernel)


def test_graph_goes_to_the_metadata(tmp_path: Path) -> None:
    weights = read_weights(samples.written(tmp_path, samples.tflite()))
    graph = json.loads(weights.metadata["graph"])
    assert graph["operators"][0]["kind"] == "conv_2d"
    assert graph["operators"][0]["options"]["stride_width"] == 2


@pytest.mark.parametrize(
    "values",
    [
        {"channels_in": 96, "padding": 0, "stride": 1},
        {"small": -3, "large": 1 << 40, "real": 1.5, "yes": True, "no": False, "text": "same"},
        {"none": None, "wide": 300, "negative": -40_000},
        {},
    ],
)
def test_flexbuffers_as_their_own_library_writes_them(values: dict[str, object]) -> None:
    flexbuffers = pytest.importorskip("flatbuffers.flexbuffers")
    assert read_flex_map(bytes(flexbuffers.Dumps(values))) == values


def test_flexbuffer_that_is_no_map_is_refused() -> None:
    flexbuffers = pytest.importorskip("flatbuffers.flexbuffers")
    with pytest.raises(ValueError, match="no map"):
        read_flex_map(bytes(flexbuffers.Dumps([1, 2])))
    with pytest.raises(ValueError, match="expected plain"):
        read_flex_map(bytes(flexbuffers.Dumps({"inner": {"a": 1}})))


@pytest.mark.parametrize("name", ["binaryNet", "floppyNet", "shallowNet"])
def test_real_binary_networks(name: str, shared: Callable[[str], Path]) -> None:
    model = read_tflite(shared(f"weights/floppynet/{name}_places365.tflite"))
    binary = [operator for operator in model.operators if operator.kind == "LceBconv2d"]
    assert len(binary) == (4 if name == "binaryNet" else 2)
    for operator in binary:
        kernel = model.tensors[operator.inputs[1]]
        assert kernel.shape[3] == operator.options["channels_in"]
        assert set(np.unique(kernel)) == {-1.0, 1.0}
    assert model.shapes[model.outputs[0]] == (1, 6, 6, 256)


def test_real_quantised_network(shared: Callable[[str], Path]) -> None:
    path = shared("weights/mobilenet/tf2_mobilenet_v2_1.0_224_ptq.tflite")
    model = read_tflite(path)
    kernels = [o.inputs[1] for o in model.operators if o.kind.endswith("conv_2d")]
    assert len(kernels) == 53
    n_weights = sum(array.size for array in model.tensors.values())
    assert n_weights == pytest.approx(3.49e6, rel=0.01)
    assert all(model.tensors[name].dtype == np.float32 for name in kernels)


def test_two_scales_for_four_channels_are_refused(tmp_path: Path) -> None:
    content = samples.tflite()
    four = np.array([0.5, 0.25, 2, 1], np.float32).tobytes()
    place = content.index(four) - 4
    damaged = content[:place] + (2).to_bytes(4, "little") + content[place + 4 :]
    with pytest.raises(InputError, match="scales for 4 channels"):
        read_weights(samples.written(tmp_path, damaged))
