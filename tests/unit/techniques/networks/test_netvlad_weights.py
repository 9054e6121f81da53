"""Every dialect in which the NetVLAD networks were published means the same network."""

from collections.abc import Iterator

import numpy as np
import pytest
import torch
from tests.unit.techniques.seeded_weights import state_of

from retraverse.errors import InputError
from retraverse.techniques.networks.mobilenet_netvlad import MobileNetNetVlad
from retraverse.techniques.networks.vgg_netvlad import VGG16_CONVOLUTIONS, VggNetVlad
from retraverse.techniques.running.torch_runtime import torch_threads
from retraverse.types import Array

Tensors = dict[str, Array]
DIMENSION = 6
CHANNELS_LAST = (2, 3, 1, 0)


@pytest.fixture(autouse=True)
def _one_thread() -> Iterator[None]:
    with torch_threads(1), torch.inference_mode():
        yield


@pytest.fixture(scope="module")
def vgg() -> Tensors:
    own = state_of(lambda: VggNetVlad(DIMENSION), seed=5)
    own["vlad.assignment.bias"][:] = 0
    own["mean"] = np.array([120, 110, 100], np.float32)
    return own


def by_channel(own: Tensors) -> Array:
    """Return the whitening of vectors that go channel by channel, (in, out)."""
    cut = own["whitening.weight"].reshape(DIMENSION, 64, 512)
    return np.ascontiguousarray(cut.transpose(2, 1, 0).reshape(-1, DIMENSION))


def as_matlab(own: Tensors) -> Tensors:
    """Return the state as MATLAB's struct has it: rows of numbers are (1, N)."""
    out = {"net.meta.normalization.averageImage": np.ones((2, 2, 1), np.float32) * own["mean"]}
    for name, (_, _, layer) in VGG16_CONVOLUTIONS.items():
        out[f"net.layers.{layer}.weights.0"] = own[f"vgg.{name}.weight"].transpose(CHANNELS_LAST)
        out[f"net.layers.{layer}.weights.1"] = own[f"vgg.{name}.bias"][np.newaxis]
    assignment = own["vlad.assignment.weight"][:, :, 0, 0]
    out["net.layers.30.weights.0"] = assignment.T[np.newaxis, np.newaxis]
    out["net.layers.30.weights.1"] = -own["vlad.centres"].T[np.newaxis, np.newaxis]
    out["net.layers.33.weights.0"] = by_channel(own)[np.newaxis, np.newaxis]
    out["net.layers.33.weights.1"] = own["whitening.bias"][np.newaxis]
    return out


def as_tensorflow(own: Tensors) -> Tensors:
    out = {"average_rgb": own["mean"]}
    for name in VGG16_CONVOLUTIONS:
        out[f"{name}/kernel"] = own[f"vgg.{name}.weight"].transpose(CHANNELS_LAST)
        out[f"{name}/bias"] = own[f"vgg.{name}.bias"]
    out["assignment/kernel"] = own["vlad.assignment.weight"].transpose(CHANNELS_LAST)
    out["cluster_centers"] = -own["vlad.centres"].T[np.newaxis, np.newaxis, np.newaxis]
    out["WPCA/kernel"] = by_channel(own)[np.newaxis, np.newaxis]
    out["WPCA/bias"] = own["whitening.bias"]
    return {f"vgg16_netvlad_pca/{name}": value for name, value in out.items()}


def as_torch(own: Tensors) -> Tensors:
    out = {}
    for name, (_, _, layer) in VGG16_CONVOLUTIONS.items():
        for kind in ("weight", "bias"):
            out[f"module.encoder.{layer}.{kind}"] = own[f"vgg.{name}.{kind}"]
    out["pool.conv.weight"] = own["vlad.assignment.weight"]
    out["pool.centroids"] = own["vlad.centres"]
    out["WPCA.0.weight"] = own["whitening.weight"][:, :, np.newaxis, np.newaxis]
    out["WPCA.0.bias"] = own["whitening.bias"]
    return out


def vectors(tensors: Tensors, picture: torch.Tensor, dimension: int = DIMENSION) -> torch.Tensor:
    network = VggNetVlad(dimension).eval()
    network.load_named(tensors)
    return network(picture)  # type: ignore[no-any-return]


def test_vgg_of_matlab_and_tensorflow_is_the_same_network(vgg: Tensors) -> None:
    picture = 255 * torch.rand((1, 3, 48, 64), generator=torch.Generator().manual_seed(1))
    expected = vectors(vgg, picture)
    assert expected.shape == (1, DIMENSION)
    for dialect in (as_matlab, as_tensorflow):
        torch.testing.assert_close(vectors(dialect(vgg), picture), expected)


def test_vgg_of_pytorch_takes_pictures_less_imagenets_mean_over_its_deviation(
    vgg: Tensors,
) -> None:
    picture = 255 * torch.rand((1, 3, 48, 64), generator=torch.Generator().manual_seed(1))
    mean, deviation = ([0.485, 0.456, 0.406], [0.229, 0.224, 0.225])
    scaled = (picture / 255 - torch.tensor(mean)[:, None, None]) / torch.tensor(deviation)[
        :, None, None
    ]
    plain = {**vgg, "mean": np.zeros(3, np.float32), "deviation": np.ones(3, np.float32)}
    torch.testing.assert_close(vectors(as_torch(vgg), picture), vectors(plain, scaled))


def test_fewer_dimensions_are_the_first_ones(vgg: Tensors) -> None:
    picture = 255 * torch.rand((1, 3, 48, 64), generator=torch.Generator().manual_seed(1))
    whole, cut = vectors(as_matlab(vgg), picture)[0], vectors(as_matlab(vgg), picture, 2)[0]
    torch.testing.assert_close(cut, whole[:2] / whole[:2].norm())


@pytest.mark.parametrize("lost", ["net.layers.5.weights.0", "net.layers.33.weights.1"])
def test_a_lost_tensor_is_named(vgg: Tensors, lost: str) -> None:
    tensors = {name: value for name, value in as_matlab(vgg).items() if name != lost}
    with pytest.raises(InputError, match=lost):
        VggNetVlad(DIMENSION).load_named(tensors)


def test_clusters_of_another_size_are_refused(vgg: Tensors) -> None:
    tensors = {**as_matlab(vgg), "net.layers.30.weights.0": np.zeros((1, 1, 512, 32), np.float32)}
    with pytest.raises(InputError, match="the clusters have shapes"):
        VggNetVlad(DIMENSION).load_named(tensors)


KERAS = {
    "0.weight": "kernel", "1.weight": "gamma", "1.bias": "beta",
    "1.running_mean": "moving_mean", "1.running_var": "moving_variance",
}  # fmt: skip


def as_keras(own: Tensors, *, frozen: bool) -> Tensors:
    """Return MobileNetV2-NetVLAD's state as in the .h5 file, or as in the frozen graph."""
    out = {}
    for name, value in own.items():
        if name.endswith("num_batches_tracked"):
            continue
        if name.startswith("vlad."):
            kind = {"vlad.assignment.weight": "kernel", "vlad.assignment.bias": "bias"}.get(name)
            array = value.reshape(16, -1).T if kind != "bias" else value
            layer, kind = "net_vlad_layer_1", kind or "cluster_centers"
            array = -array if kind == "cluster_centers" else array
            array = array[np.newaxis, np.newaxis]
        else:
            layer, kind, array = keras_layer(name, value)
        out[f"{layer}/{kind}" if frozen else f"{layer}/{layer}/{kind}:0"] = array
    return out


def keras_layer(name: str, value: Array) -> tuple[str, str, Array]:
    module, _, key = name.partition(".")
    if module == "stem":
        layer = "Conv1" if key.startswith("0") else "bn_Conv1"
    else:
        number, part, key = key.split(".", 2)
        layer = f"block_{number}_{part}" if number != "0" else f"expanded_conv_{part}"
        layer += "_BN" if key.startswith("1") else ""
    if layer.endswith("_depthwise"):
        return layer, "depthwise_kernel", value.transpose(2, 3, 0, 1)
    return layer, KERAS[key], value.transpose(CHANNELS_LAST) if value.ndim == 4 else value


@pytest.mark.parametrize("frozen", [True, False])
def test_mobilenet_of_keras_and_of_the_frozen_graph(frozen: bool) -> None:
    own = state_of(MobileNetNetVlad, seed=6)
    picture = torch.randn((1, 3, 64, 80), generator=torch.Generator().manual_seed(1))
    networks = [MobileNetNetVlad().eval() for _ in range(2)]
    networks[0].load_named(own)
    networks[1].load_named(as_keras(own, frozen=frozen))
    torch.testing.assert_close(networks[1](picture), networks[0](picture))


def test_mobilenet_refuses_other_tensors() -> None:
    with pytest.raises(InputError, match="weights of another network"):
        MobileNetNetVlad().load_named({"conv1.0": np.zeros(3)})
    short = as_keras(state_of(MobileNetNetVlad), frozen=True)
    del short["block_4_expand_BN/beta"]
    with pytest.raises(InputError, match=r"no 'blocks.4.expand.1.bias'"):
        MobileNetNetVlad().load_named(short)
