"""EfficientNet-Lite0's module: padding as TensorFlow has it, shapes of every block, refusals."""

import pytest
import torch
from torch.nn import functional

from retraverse.errors import ConfigError, InputError
from retraverse.techniques.networks.efficientnet_lite import (
    LITE0_BLOCKS,
    EfficientNetLite0,
    SameConv2d,
)


@pytest.mark.parametrize(
    ("size", "kernel", "stride", "before", "after"),
    # By TensorFlow's rule: total = max((ceil(size / stride) - 1) * stride + kernel - size, 0).
    [(224, 3, 2, 0, 1), (225, 3, 2, 1, 1), (112, 5, 2, 1, 2), (7, 3, 1, 1, 1), (9, 1, 2, 0, 0)],
)
def test_padding(size: int, kernel: int, stride: int, before: int, after: int) -> None:
    torch.manual_seed(size)
    convolution = SameConv2d(2, 3, kernel, stride, bias=False)
    x = torch.randn(1, 2, size, size)
    expected = functional.conv2d(
        functional.pad(x, (before, after, before, after)), convolution.weight, stride=stride
    )
    got = convolution(x)
    assert got.shape[-1] == -(-size // stride)
    torch.testing.assert_close(got, expected)


def test_every_block_has_its_published_size() -> None:
    # Channels and side for a picture of 64 x 64: table 1 of the paper, Lite's stem of 32.
    stages = [
        (1, 16, 32),
        (2, 24, 16),
        (2, 40, 8),
        (3, 80, 4),
        (3, 112, 4),
        (4, 192, 2),
        (1, 320, 2),
    ]
    expected = [(channels, side) for repeats, channels, side in stages for _ in range(repeats)]
    assert [block.outputs for block in LITE0_BLOCKS] == [channels for channels, _ in expected]
    network = EfficientNetLite0(16).eval()
    x = torch.zeros(1, 3, 64, 64)
    with torch.no_grad():
        for n_blocks in (1, 2, 8, 12, 16):
            cut = EfficientNetLite0(n_blocks).eval()
            channels, side = expected[n_blocks - 1]
            assert cut(x).shape == (1, channels, side, side)
            assert cut.n_channels == channels
    assert sum(one.numel() for one in network.parameters()) < 4e6


def test_parameters_of_the_whole_network() -> None:
    network = EfficientNetLite0(16, head=True)
    # The published 4.65 million.
    assert sum(one.numel() for one in network.parameters()) == pytest.approx(4.65e6, rel=0.005)


def test_wrong_requests_and_weights() -> None:
    for n_blocks in (0, 17):
        with pytest.raises(ConfigError, match="expected 1 to 16"):
            EfficientNetLite0(n_blocks)
    with pytest.raises(ConfigError, match="needs all 16 blocks"):
        EfficientNetLite0(8, head=True)
    network = EfficientNetLite0(1)
    state = dict(network.state_dict())
    with pytest.raises(InputError, match=r"no '_conv_stem.weight' among 0 tensors"):
        network.load_named({})
    state["_conv_stem.weight"] = torch.zeros(32, 3, 5, 5)
    with pytest.raises(InputError, match="shape"):
        network.load_named(state)


def test_half_precision_weights_load() -> None:
    network = EfficientNetLite0(1)
    network.load_named({name: value.half() for name, value in network.state_dict().items()})
    assert network._conv_stem.weight.dtype == torch.float32
