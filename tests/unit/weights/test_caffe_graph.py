"""Prototxt files: both layer formats, phases, and what is wrong in a damaged one."""

import contextlib
import random
import secrets
from collections.abc import Callable
from pathlib import Path

import pytest

from retraverse.errors import DataMissingError, InputError
from retraverse.weights.caffe_graph import parse_prototxt, read_prototxt

NET = """
name: 'small'  # a comment { with a brace
input: "data"
input_dim: 10 input_dim: 3
input_dim: 227, input_dim: 227;
layer {
  name: "conv1" type: "Convolution" bottom: "data" top: "conv1"
  convolution_param < num_output: 96 kernel_size: [11, 5] bias_term: false
    weight_filler { type: "gaussian" std: 0.01 } >
}
layer { name: "relu1" type: "ReLU" bottom: "conv1" top: "conv1"
        relu_param { negative_slope: 1e-2 } }
layer { name: "loss" type: "SoftmaxWithLoss" bottom: "conv1" include { phase: TRAIN } }
layer { name: "drop" type: "Dropout" bottom: "conv1" top: "conv1" exclude { phase: TEST } }
layer { name: "acc" type: "Accuracy" bottom: "conv1" include { phase: TEST } }
"""


def test_layers_inputs_and_settings() -> None:
    graph = parse_prototxt(NET)
    assert graph.name == "small"
    assert graph.inputs == {"data": (10, 3, 227, 227)}
    assert [layer.name for layer in graph.layers] == ["conv1", "relu1"]
    conv, relu = graph.layers
    assert (conv.kind, conv.bottoms, conv.tops) == ("Convolution", ("data",), ("conv1",))
    assert conv.values("convolution_param.kernel_size") == (11, 5)
    assert conv.integer("convolution_param.num_output", 0) == 96
    assert conv.integer("convolution_param.group", 1) == 1
    assert conv.flag("convolution_param.bias_term", True) is False
    assert conv.word("convolution_param.weight_filler.type", "") == "gaussian"
    assert relu.real("relu_param.negative_slope", 0) == 0.01
    assert relu.bottoms == relu.tops


@pytest.mark.parametrize(
    "text",
    [
        'input: "x" input_shape { dim: 1 dim: 2 } layer { name: "a" }',
        'layer { name: "x" type: "Input" top: "x" input_param { shape: { dim: 1 dim: 2 } } }',
    ],
)
def test_other_ways_to_give_an_input(text: str) -> None:
    assert parse_prototxt(text).inputs == {"x": (1, 2)}


def test_old_layers_get_new_names() -> None:
    graph = parse_prototxt('layers { name: "ip" type: INNER_PRODUCT bottom: "a" top: "b" }')
    assert graph.layers[0].kind == "InnerProduct"


WRONG = {
    "no net": ("", "no layers"),
    "caffemodel": ("\x0a\x04net\xa2", "line"),
    "unclosed": ('layer { name: "a"\n', "ends before a '}'"),
    "stray brace": ('layer { name: "a" }\n}', "line 2 has '}'"),
    "no value": ("layer { name: ", "ends after 'name'"),
    "bad value": ("layer {\n\nname: : }", "line 3"),
    "bad number": ("layer { pad: 1x2 }", "1x2"),
    "unclosed list": ("layer { pad: [1, 2", "ends after 'pad'"),
    "deep": ("layer {" + "a {" * 50, "16 deep"),
    "inputs": ('input: "a" input: "b" input_dim: 1 layer { }', "2 inputs but 1"),
    "size": ('input: "a" input_shape { dim: -1 } layer { }', "shape"),
}


@pytest.mark.parametrize("case", WRONG)
def test_damage_is_named(case: str, tmp_path: Path) -> None:
    text, reason = WRONG[case]
    path = tmp_path / "net.prototxt"
    path.write_bytes(b"\n" if not text else text.encode("latin-1"))
    with pytest.raises(InputError, match=reason if case != "caffemodel" else "prototxt"):
        read_prototxt(path)


def test_settings_of_a_wrong_type_are_refused() -> None:
    layer = parse_prototxt('layer { name: "a" p { pad: 1.5 word: "x" on: true } }').layers[0]
    for path in ("p.pad", "p.on"):
        with pytest.raises(InputError, match="whole number"):
            layer.integer(path, 0)
    with pytest.raises(InputError, match="expected a number"):
        layer.real("p.word", 0)


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(DataMissingError):
        read_prototxt(tmp_path / "none.prototxt")


def test_mutations_are_read_or_refused(tmp_path: Path, scaled: Callable[[int], int]) -> None:
    seed = secrets.randbits(32)
    print(f"seed {seed}")
    path = tmp_path / "net.prototxt"
    for i in range(scaled(1000)):
        chance = random.Random(seed + i)
        content = bytearray(NET.encode())
        for _ in range(chance.randrange(1, 6)):
            place = chance.randrange(len(content))
            content[place : place + chance.randrange(3)] = chance.choice(
                [
                    b"{",
                    b"}",
                    b'"',
                    b"[",
                    b"<",
                    b"9" * 30,
                    b"-",
                    b"\xff",
                    b"#",
                    bytes([chance.randrange(256)]),
                ]
            )
        path.write_bytes(content)
        with contextlib.suppress(InputError):
            assert read_prototxt(path).layers


REAL = {
    "alexnet_vpr_deploy": ("data", (10, 3, 227, 227), 23),
    "amosnet_deploy": ("data", (10, 3, 227, 227), 22),
    "calc_deploy": ("X1", (1, 1, 120, 160), 11),
    "hybridnet_deploy": ("data", (10, 3, 227, 227), 22),
    "regionvlad_deploy": ("data", (10, 3, 227, 227), 23),
}


@pytest.mark.parametrize("name", REAL)
def test_real_graphs(name: str, shared: Callable[[str], Path]) -> None:
    path = shared(f"weights/prototxt/{name}.prototxt")
    blob, shape, n_layers = REAL[name]
    graph = read_prototxt(path)
    assert graph.inputs == {blob: shape}
    written = path.read_text().count("layer {") + path.read_text().count("layers {")
    assert len(graph.layers) == n_layers == written - (name == "calc_deploy")
