"""The NetVLAD layer against its equation, term by term."""

import numpy as np
import pytest
import torch

from retraverse.techniques.networks.netvlad_layer import LEAST_LENGTH, NetVlad
from retraverse.types import Array


def by_the_equation(
    maps: Array, kernel: Array, bias: Array, centres: Array, normalise: bool
) -> Array:
    """Return V(j, k) = sum_i a_k(x_i) (x_i(j) - c_k(j)), equation 4, normalised twice."""
    clusters, channels = centres.shape
    vlad = np.zeros((clusters, channels))
    for row in range(maps.shape[1]):
        for column in range(maps.shape[2]):
            x = maps[:, row, column].astype(np.float64)
            if normalise:
                x = x / np.sqrt((x**2).sum())
            strengths = np.exp([kernel[k] @ x + bias[k] for k in range(clusters)])
            for k in range(clusters):
                vlad[k] += strengths[k] / strengths.sum() * (x - centres[k])
    vlad /= np.sqrt((vlad**2).sum(axis=1, keepdims=True))
    return np.asarray(vlad.ravel() / np.sqrt((vlad**2).sum()))


@pytest.mark.parametrize("normalise", [True, False])
def test_it_is_the_papers_equation(normalise: bool) -> None:
    torch.manual_seed(4)
    layer = NetVlad(6, 5, bias=True, normalise_input=normalise)
    maps = torch.randn(2, 6, 3, 4)
    with torch.inference_mode():
        found = layer(maps).numpy()
    kernel = layer.assignment.weight.detach().numpy().reshape(5, 6)
    assert layer.assignment.bias is not None
    bias, centres = layer.assignment.bias.detach().numpy(), layer.centres.detach().numpy()
    for vector, one in zip(found, maps.numpy(), strict=True):
        expected = by_the_equation(one, kernel, bias, centres, normalise)
        np.testing.assert_allclose(vector, expected, atol=1e-6)


def test_a_cluster_that_nothing_is_near_stays_small() -> None:
    layer = NetVlad(2, 2, bias=True, normalise_input=False)
    assert layer.assignment.bias is not None
    with torch.inference_mode():
        layer.assignment.weight.zero_()
        # Of the share of the second cluster, exp(-18), its residual gets 1.5e-8 in length.
        layer.assignment.bias.copy_(torch.tensor([0.0, -18.0]))
        layer.centres.zero_()
        found = layer(torch.ones(1, 2, 1, 1))[0].reshape(2, 2)
    expected = np.exp(-18) * np.sqrt(2) / LEAST_LENGTH
    np.testing.assert_allclose(found[1].norm() / found[0].norm(), expected, rtol=1e-3)
