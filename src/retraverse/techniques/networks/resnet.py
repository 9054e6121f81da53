"""ResNet 18, 50, 101 and 152, without average pooling and classifier.

Conventions
- Input is float32 (N, 3, H, W), RGB, 0..1 less ImageNet's mean, by its deviation.
- Names of parameters are those of the published ImageNet weights (``layer1.0.conv1.weight``).
- Where a stage halves the size, a bottleneck does it in its 3 x 3 convolution ("v1.5").

References
----------
He, Zhang, Ren, Sun: Deep Residual Learning for Image Recognition, CVPR 2016, table 1.
"""

from torch import Tensor, nn
from torch.nn import functional

__all__ = ["DEPTHS", "RESNET_CHANNELS", "SEQUENTIAL_NAMES", "ResNet"]

DEPTHS = {18: (2, 2, 2, 2), 50: (3, 4, 6, 3), 101: (3, 4, 23, 3), 152: (3, 8, 36, 3)}
"""Depth -> blocks of each stage."""
_BOTTLENECK_FROM = 50
_WIDTHS = (64, 128, 256, 512)
_EXPANSION = 4
RESNET_CHANNELS = {depth: 512 if depth < _BOTTLENECK_FROM else 2048 for depth in DEPTHS}
"""Depth -> channels after the last stage."""

SEQUENTIAL_NAMES = (
    ("0.", "conv1."),
    ("1.", "bn1."),
    *((f"{3 + stage}.", f"layer{stage}.") for stage in (1, 2, 3, 4)),
)
"""Names in checkpoints that keep the parts in a row (2 and 3, ReLU and pooling, hold nothing)."""


class _Basic(nn.Module):
    """Two 3 x 3 convolutions and the shortcut."""

    def __init__(self, inputs: int, width: int, stride: int) -> None:
        super().__init__()
        self.conv1 = nn.Conv2d(inputs, width, 3, stride, 1, bias=False)
        self.bn1 = nn.BatchNorm2d(width)
        self.conv2 = nn.Conv2d(width, width, 3, 1, 1, bias=False)
        self.bn2 = nn.BatchNorm2d(width)
        self.downsample = _shortcut(inputs, width, stride)

    def forward(self, x: Tensor) -> Tensor:
        """Return (N, width, H / stride, W / stride)."""
        y = functional.relu(self.bn1(self.conv1(x)))
        return functional.relu(self.bn2(self.conv2(y)) + self.downsample(x))


class _Bottleneck(nn.Module):
    """Narrow, look around, widen, and the shortcut."""

    def __init__(self, inputs: int, width: int, stride: int) -> None:
        super().__init__()
        outputs = width * _EXPANSION
        self.conv1 = nn.Conv2d(inputs, width, 1, bias=False)
        self.bn1 = nn.BatchNorm2d(width)
        self.conv2 = nn.Conv2d(width, width, 3, stride, 1, bias=False)
        self.bn2 = nn.BatchNorm2d(width)
        self.conv3 = nn.Conv2d(width, outputs, 1, bias=False)
        self.bn3 = nn.BatchNorm2d(outputs)
        self.downsample = _shortcut(inputs, outputs, stride)

    def forward(self, x: Tensor) -> Tensor:
        """Return (N, 4 * width, H / stride, W / stride)."""
        y = functional.relu(self.bn1(self.conv1(x)))
        y = functional.relu(self.bn2(self.conv2(y)))
        return functional.relu(self.bn3(self.conv3(y)) + self.downsample(x))


class ResNet(nn.Module):
    """ResNet up to one of its four stages.

    Parameters
    ----------
    depth : {18, 50, 101, 152}
    n_stages : int in [1, 4]
        3 gives maps at a sixteenth of the picture's size, 4 at a thirty-second.
    """

    def __init__(self, depth: int, n_stages: int = 4) -> None:
        super().__init__()
        block = _Basic if depth < _BOTTLENECK_FROM else _Bottleneck
        expansion = RESNET_CHANNELS[depth] // _WIDTHS[-1]
        self.conv1 = nn.Conv2d(3, 64, 7, 2, 3, bias=False)
        self.bn1 = nn.BatchNorm2d(64)
        channels = 64
        for stage in range(n_stages):
            width, stride = _WIDTHS[stage], 1 if stage == 0 else 2
            blocks = [block(channels, width, stride)]
            channels = width * expansion
            blocks += [block(channels, width, 1) for _ in range(DEPTHS[depth][stage] - 1)]
            setattr(self, f"layer{stage + 1}", nn.Sequential(*blocks))
        self.channels = channels
        self._stages = [f"layer{stage + 1}" for stage in range(n_stages)]

    def forward(self, x: Tensor) -> Tensor:
        """Return the maps of the last stage, (N, channels, H / 2**(n + 1), W / 2**(n + 1))."""
        x = functional.relu(self.bn1(self.conv1(x)))
        x = functional.max_pool2d(x, 3, 2, 1)
        for stage in self._stages:
            x = getattr(self, stage)(x)
        return x


def _shortcut(inputs: int, outputs: int, stride: int) -> nn.Module:
    if stride == 1 and inputs == outputs:
        return nn.Identity()
    return nn.Sequential(nn.Conv2d(inputs, outputs, 1, stride, bias=False), nn.BatchNorm2d(outputs))
