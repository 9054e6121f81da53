"""Any .onnx file: graphs made here node by node, so that what comes out is known."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import retraverse as rt
from retraverse.errors import ConfigError, DataMissingError, InputError
from retraverse.types import Array, ImageArray

onnx = pytest.importorskip("onnx", reason="the extra 'learned' is not installed")
pytest.importorskip("onnxruntime", reason="the extra 'learned' is not installed")

PLAIN = {"mean": "0", "std": "1", "scale": 1.0}


def graph(path: Path, shape: list[Any], *, kind: str = "FLOAT", second: bool = False) -> Path:
    """Write a graph that gives its input back, and its negative as a second output."""
    from onnx import TensorProto, helper

    element = getattr(TensorProto, kind)
    outputs = [helper.make_tensor_value_info("same", TensorProto.FLOAT, shape)]
    nodes = [helper.make_node("Cast", ["pictures"], ["same"], to=TensorProto.FLOAT)]
    if second:
        outputs.append(helper.make_tensor_value_info("negative", TensorProto.FLOAT, shape))
        nodes.append(helper.make_node("Neg", ["same"], ["negative"]))
    taken = helper.make_tensor_value_info("pictures", element, shape)
    made = helper.make_graph(nodes, "toy", [taken], outputs)
    model = helper.make_model(made, opset_imports=[helper.make_opsetid("", 17)])
    model.ir_version = 8
    path.write_bytes(model.SerializeToString())
    return path


def picture(seed: int = 0) -> ImageArray:
    return np.random.default_rng(seed).integers(0, 256, (8, 8, 3)).astype(np.uint8)


def unit(values: Array) -> Array:
    return np.asarray(values.ravel() / np.linalg.norm(values))


def test_what_comes_out_is_what_went_in(tmp_path: Path) -> None:
    file = graph(tmp_path / "g.onnx", ["n", 3, 8, 8])
    technique = rt.technique("onnx", weights=file, **PLAIN)
    assert technique.layout.descriptor.shape == (192,)
    got = technique.describe(picture())["descriptor"]
    np.testing.assert_allclose(got, unit(picture().transpose(2, 0, 1).astype(float)), atol=1e-6)


def test_channels_axes_mean_and_deviation(tmp_path: Path) -> None:
    image = picture().astype(float)
    nhwc = graph(tmp_path / "last.onnx", ["n", 8, 8, 3])
    blue_first = rt.technique("onnx", weights=nhwc, axes="nhwc", channels="bgr", **PLAIN)
    np.testing.assert_allclose(
        blue_first.describe(picture())["descriptor"], unit(image[:, :, ::-1]), atol=1e-6
    )
    file = graph(tmp_path / "g.onnx", ["n", 3, 8, 8])
    usual = rt.technique("onnx", weights=file)
    expected = (image / 255 - [0.485, 0.456, 0.406]) / [0.229, 0.224, 0.225]
    np.testing.assert_allclose(
        usual.describe(picture())["descriptor"], unit(expected.transpose(2, 0, 1)), atol=1e-5
    )
    one = graph(tmp_path / "grey.onnx", ["n", 1, 8, 8])
    grey = rt.technique("onnx", weights=one, channels="grey", **PLAIN)
    np.testing.assert_allclose(
        grey.describe(picture())["descriptor"], unit(image @ [0.299, 0.587, 0.114]), atol=1e-2
    )


@pytest.mark.parametrize("kind", ["FLOAT", "FLOAT16", "DOUBLE", "UINT8"])
def test_types_of_input(tmp_path: Path, kind: str) -> None:
    file = graph(tmp_path / "g.onnx", ["n", 3, 8, 8], kind=kind)
    got = rt.technique("onnx", weights=file, **PLAIN).describe(picture())["descriptor"]
    np.testing.assert_allclose(got, unit(picture().transpose(2, 0, 1).astype(float)), atol=1e-5)


def test_output_by_name_and_pooling(tmp_path: Path) -> None:
    file = graph(tmp_path / "g.onnx", ["n", 3, 8, 8], second=True)
    negative = rt.technique("onnx", weights=file, output="negative", **PLAIN)
    first = rt.technique("onnx", weights=file, **PLAIN)
    a, b = (t.describe(picture())["descriptor"] for t in (negative, first))
    np.testing.assert_array_equal(a, -b)
    pooled = rt.technique("onnx", weights=file, pooling="mean", **PLAIN)
    expected = unit(picture().mean((0, 1)))
    np.testing.assert_allclose(pooled.describe(picture())["descriptor"], expected, atol=1e-6)
    with pytest.raises(ConfigError, match="got 'third', expected one of same, negative"):
        rt.technique("onnx", weights=file, output="third")


def test_graph_of_one_picture_takes_many_one_by_one(tmp_path: Path) -> None:
    file = graph(tmp_path / "g.onnx", [1, 3, 8, 8])
    technique = rt.technique("onnx", weights=file, batch=3, **PLAIN)
    pictures = [picture(seed) for seed in range(5)]
    batch = technique.describe_batch(pictures)  # type: ignore[attr-defined]
    for one, image in zip(batch, pictures, strict=True):
        np.testing.assert_array_equal(one["descriptor"], technique.describe(image)["descriptor"])


def test_size_is_the_graphs_or_must_be_said(tmp_path: Path) -> None:
    file = graph(tmp_path / "g.onnx", ["n", 3, "h", "w"])
    with pytest.raises(InputError, match=r"any size.*say resolution="):
        rt.technique("onnx", weights=file)
    for resize in ("area", "bilinear", "bicubic"):
        technique = rt.technique("onnx", weights=file, resolution=16, resize=resize)
        assert technique.layout.dimension == 3 * 16 * 16


def test_map_is_tied_to_the_content_of_the_file(tmp_path: Path) -> None:
    drive = rt.open_traverse([picture(seed) for seed in range(3)])
    file = graph(tmp_path / "g.onnx", ["n", 3, 8, 8])
    rt.build_map(drive, rt.technique("onnx", weights=file), path=tmp_path / "route.map")
    again = rt.load_map(tmp_path / "route.map")
    assert (rt.similarity(drive, again).argmax(axis=1) == np.arange(3)).all()
    graph(file, ["n", 3, 8, 8], second=True)
    with pytest.raises(InputError):
        rt.load_map(tmp_path / "route.map", technique=rt.technique("onnx", weights=file))


def test_map_can_be_looked_at_without_the_file(tmp_path: Path) -> None:
    drive = rt.open_traverse([picture(seed) for seed in range(3)])
    file = graph(tmp_path / "g.onnx", ["n", 3, 8, 8])
    rt.build_map(drive, rt.technique("onnx", weights=file), path=tmp_path / "route.map")
    file.unlink()
    route = rt.load_map(tmp_path / "route.map")
    assert route.technique.layout.dimension == 192
    with pytest.raises(DataMissingError, match=r"there is no file .*g\.onnx"):
        rt.similarity(drive, route)


def test_length_that_was_said_must_hold(tmp_path: Path) -> None:
    file = graph(tmp_path / "g.onnx", ["n", 3, 8, 8])
    with pytest.raises(InputError, match="the graph gives 192 numbers, expected dimension=7"):
        rt.technique("onnx", weights=file, dimension=7).describe(picture())


@pytest.mark.parametrize(
    ("parameters", "error", "message"),
    [
        ({}, DataMissingError, r"weights=PATH.onnx"),
        ({"weights": "absent.onnx"}, DataMissingError, "there is no file 'absent.onnx'"),
        ({"mean": "a,b,c"}, ConfigError, "expected one number or three"),
        ({"mean": "1,2"}, ConfigError, "expected one number or three"),
        ({"std": "0"}, ConfigError, "other than 0"),
        ({"scale": 0}, ConfigError, "more than 0"),
        ({"resolution": 3}, ConfigError, "8 to 4096"),
        ({"runtime": "torch"}, ConfigError, "expected one of 'onnx'"),
    ],
)
def test_wrong_settings(
    parameters: dict[str, object], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        rt.technique("onnx", **parameters).describe(picture())


def test_files_that_are_no_graphs(tmp_path: Path) -> None:
    (tmp_path / "bad.onnx").write_bytes(b"no graph at all")
    with pytest.raises(InputError, match="ONNX Runtime refuses it"):
        rt.technique("onnx", weights=tmp_path / "bad.onnx")
    vectors = graph(tmp_path / "two.onnx", ["n", 7])
    with pytest.raises(InputError, match="expected one of pictures, four axes"):
        rt.technique("onnx", weights=vectors)
