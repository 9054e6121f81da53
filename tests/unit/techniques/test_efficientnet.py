from typing import Any

import numpy as np
import pytest
import torch
from skimage import data
from tests.unit.techniques.tiny_network import pictures

import retraverse as rt
from retraverse.errors import ConfigError
from retraverse.techniques.efficientnet import _BLOCKS, EfficientNet, EfficientNetParameters
from retraverse.techniques.networks.efficientnet_lite import LITE0_BLOCKS, EfficientNetLite0
from retraverse.techniques.running.torch_runtime import torch_threads
from retraverse.weights.store import load_tensors

CAT, ESPRESSO = 285, 967


def test_prepared_as_its_weights_want_it_names_what_it_sees() -> None:
    technique = EfficientNet()
    network = EfficientNetLite0(head=True).eval()
    network.load_named(load_tensors(technique.weights_path()).tensors)
    photographs: list[Any] = [data.chelsea(), data.coffee()]  # type: ignore[no-untyped-call]
    shown = np.stack([technique.prepare(photograph) for photograph in photographs])
    with torch_threads(1), torch.inference_mode():
        classes = network(torch.from_numpy(shown)).argmax(1)
    assert classes.tolist() == [CAT, ESPRESSO]


def test_the_table_of_blocks_is_the_networks() -> None:
    stride, expected = 2, []
    for block in LITE0_BLOCKS:
        stride *= block.stride
        expected.append((block.outputs, stride))
    assert list(_BLOCKS) == expected


@pytest.mark.parametrize(
    ("block", "pooling", "resolution"),
    [(0, "mean", 65), (5, "grid4_max", 100), (7, "flat", 224), (11, "flat", 200), (15, "gem", 64)],
)
def test_the_layout_is_known_before_the_network_is(
    block: int, pooling: str, resolution: int
) -> None:
    technique = rt.technique("efficientnet", block=block, pooling=pooling, resolution=resolution)
    described = technique.describe(pictures(1)[0])["descriptor"]
    assert described.shape == technique.layout.descriptor.shape


def test_the_default_is_the_measured_one() -> None:
    parameters = EfficientNetParameters()
    assert (parameters.block, parameters.pooling, parameters.resolution) == (11, "flat", 224)
    assert EfficientNet().layout.dimension == 192 * 7 * 7


def test_weights_shipped_with_the_program_are_found_by_name(
    monkeypatch: pytest.MonkeyPatch, tmp_path_factory: pytest.TempPathFactory
) -> None:
    from retraverse.techniques import efficientnet

    folder = tmp_path_factory.mktemp("shipped")
    (folder / "efficientnet_jpeg.safetensors").write_bytes(b"tuned")
    monkeypatch.setattr(efficientnet, "_SHIPPED", folder)
    tuned = EfficientNet(EfficientNetParameters(weights="jpeg"))
    assert tuned.weights_path() == folder / "efficientnet_jpeg.safetensors"
    assert tuned.fingerprint() != EfficientNet().fingerprint()


@pytest.mark.parametrize("wrong", [{"block": 16}, {"block": -1}, {"resolution": 32}])
def test_ranges(wrong: dict[str, int]) -> None:
    with pytest.raises(ConfigError, match=r"efficientnet \w+: got"):
        EfficientNetParameters(**wrong)  # type: ignore[arg-type]
