"""The NetVLAD layer: soft assignment to clusters, residuals summed, normalised twice.

References
----------
Arandjelović, Gronat, Torii, Pajdla, Sivic: NetVLAD: CNN architecture for weakly supervised place
recognition, CVPR 2016, equation 4 and section 3.1.
"""

import torch
from torch import Tensor, nn
from torch.nn import functional

__all__ = ["LEAST_LENGTH", "NetVlad"]

LEAST_LENGTH = 1e-6
"""Vectors shorter than this are divided by it, not by their length: a cluster that nothing was
assigned to stays near zero. TensorFlow's and MatConvNet's normalisations square it to 1e-12."""


class NetVlad(nn.Module):
    """Feature maps (N, D, H, W) to one unit vector (N, K * D).

    Parameters
    ----------
    channels : int
        D, of every local feature.
    clusters : int
        K.
    bias : bool
        Whether the assignment has one (equation 3) or was trained without.
    normalise_input : bool
        Whether local features are made unit vectors first.
    """

    def __init__(self, channels: int, clusters: int, *, bias: bool, normalise_input: bool) -> None:
        super().__init__()
        self._normalise_input = normalise_input
        self.assignment = nn.Conv2d(channels, clusters, 1, bias=bias)
        self.centres = nn.Parameter(torch.randn(clusters, channels) / channels**0.5)

    def forward(self, x: Tensor) -> Tensor:
        """Return the vector: for each of K clusters, its D dimensions."""
        if self._normalise_input:
            x = _unit(x, 1)
        shares = functional.softmax(self.assignment(x), dim=1).flatten(2)
        sums = torch.matmul(shares, x.flatten(2).transpose(1, 2))
        residuals = sums - self.centres * shares.sum(dim=2).unsqueeze(2)
        return _unit(_unit(residuals, 2).flatten(1), 1)


def _unit(x: Tensor, axis: int) -> Tensor:
    return functional.normalize(x, dim=axis, eps=LEAST_LENGTH)
