"""Networks of one bit a weight, against sums of whole numbers."""

from collections.abc import Iterator

import numpy as np
import pytest
import torch
from tests.unit.techniques.seeded_weights import state_of

from retraverse.errors import InputError
from retraverse.techniques.networks.binary_alexnet import BINARY_NETS, BinaryAlexNet
from retraverse.techniques.running.torch_runtime import torch_threads
from retraverse.types import Array

Tensors = dict[str, Array]


@pytest.fixture(autouse=True)
def _one_thread() -> Iterator[None]:
    with torch_threads(1), torch.inference_mode():
        yield


def state(kind: str) -> Tensors:
    return state_of(lambda: BinaryAlexNet(kind), seed=3)


def as_published(own: Tensors) -> Tensors:
    """Return a state as the converter writes it: channels last, odd names, no order."""
    n_convolutions = sum(name.endswith("scale") for name in own)
    published = {"net/conv1/QuantConv2D1": own["conv1.weight"].transpose(0, 2, 3, 1)}
    published["net/conv1/QuantConv2D"] = np.zeros(96, np.float32)
    for index in reversed(range(n_convolutions)):
        layer = f"net/conv{index + 2}"
        kernel = own[f"binary.{index}.weight"].transpose(0, 2, 3, 1)
        published[f"{layer}/QuantConv2D;net/"] = kernel
        fused = ";net_" if index >= 2 else ""
        scale, offset = ("2", "1") if fused else ("", "1")
        published[f"{layer}_bn/FusedBatchNormV3{fused}{offset}"] = own[f"binary.{index}.offset"]
        published[f"{layer}_bn/FusedBatchNormV3{fused}{scale}"] = own[f"binary.{index}.scale"]
        published[f"{layer}/QuantConv2D;net/1"] = np.ones(len(kernel), np.float32)
    return published


def loaded(kind: str, tensors: Tensors) -> BinaryAlexNet:
    network = BinaryAlexNet(kind)
    network.load_named(tensors)
    return network.eval()


@pytest.mark.parametrize("kind", sorted(BINARY_NETS))
def test_published_tensors_find_their_places(kind: str) -> None:
    own = state(kind)
    own |= {name: np.abs(value) + 0.1 for name, value in own.items() if name.endswith("scale")}
    own["conv1.bias"] = np.zeros(96, np.float32)
    picture = torch.rand((1, 3, 227, 227), generator=torch.Generator().manual_seed(1))
    found = loaded(kind, as_published(own))(picture)
    assert found.shape == (1, 256, 6, 6)
    torch.testing.assert_close(found, loaded(kind, own)(picture), rtol=0, atol=0)


@pytest.mark.parametrize("kind", ["floppynet", "shallownet"])
def test_a_binary_convolution_is_a_sum_of_signs(kind: str) -> None:
    own, border = state(kind), int(BINARY_NETS[kind].border)
    convolution = loaded(kind, own).binary[1]
    maps = torch.randn((1, 256, 4, 4), generator=torch.Generator().manual_seed(2))
    maps[0, :, 0, 0] = -convolution.offset / convolution.scale  # type: ignore[operator]
    found = convolution(maps)[0].numpy().astype(int)
    scale, offset = own["binary.1.scale"], own["binary.1.offset"]
    signs = np.where(maps[0].numpy() * scale[:, None, None] + offset[:, None, None] >= 0, 1, -1)
    padded = np.full((256, 6, 6), border)
    padded[:, 1:5, 1:5] = signs
    kernel = own["binary.1.weight"].astype(int)
    sums = np.array([
        [[(padded[:, y : y + 3, x : x + 3] * one).sum() for x in range(4)] for y in range(4)]
        for one in kernel
    ])  # fmt: skip
    np.testing.assert_array_equal(found, sums.reshape(256, 2, 2, 2, 2).max(axis=(2, 4)))


def test_other_tensors_are_refused() -> None:
    own = as_published(state("floppynet"))
    with pytest.raises(InputError, match=r"0 kernels of shape \(384, 256, 3, 3\), expected one"):
        loaded("binarynet", own)
    without = {name: value for name, value in own.items() if "_bn" not in name}
    with pytest.raises(InputError, match="0 vectors for the normalisation 'conv2_bn'"):
        loaded("floppynet", without)
