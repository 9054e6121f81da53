"""VGG16 up to conv5_3, NetVLAD with 64 clusters, and whitening by PCA.

Conventions
- Input is float32 (N, 3, H, W), RGB, 0..255; the mean colour is among the weights.
- Local features are conv5_3 before its ReLU, 512 channels, one sixteenth of the picture's side.
- The vector holds, cluster by cluster, 512 residuals; whitened, 4096 numbers or the first of them.
- `load_named` takes MATLAB's struct (``net.layers.0.weights.0``), the TensorFlow port's names
  (``vgg16_netvlad_pca/conv1_1/kernel``), those of PyTorch ports (``encoder.0.weight``), or the
  network's own.

References
----------
Arandjelović, Gronat, Torii, Pajdla, Sivic: NetVLAD: CNN architecture for weakly supervised place
recognition, CVPR 2016, sections 3 and 5.1; Simonyan, Zisserman: Very Deep Convolutional Networks
for Large-Scale Image Recognition, ICLR 2015, table 1, configuration D; Cieslewski, Choudhary,
Scaramuzza: Data-Efficient Decentralized Visual SLAM, ICRA 2018 (the TensorFlow port).
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
import torch
from torch import Tensor, nn
from torch.nn import functional

from retraverse.errors import InputError
from retraverse.techniques.networks.loading import load_checked, tensor_named
from retraverse.techniques.networks.netvlad_layer import NetVlad

__all__ = ["CHANNELS", "N_CLUSTERS", "VGG16_CONVOLUTIONS", "VggNetVlad"]

VGG16_CONVOLUTIONS = {
    # name -> channels in and out, and its number among the layers of MatConvNet and torchvision
    "conv1_1": (3, 64, 0), "conv1_2": (64, 64, 2),
    "conv2_1": (64, 128, 5), "conv2_2": (128, 128, 7),
    "conv3_1": (128, 256, 10), "conv3_2": (256, 256, 12), "conv3_3": (256, 256, 14),
    "conv4_1": (256, 512, 17), "conv4_2": (512, 512, 19), "conv4_3": (512, 512, 21),
    "conv5_1": (512, 512, 24), "conv5_2": (512, 512, 26), "conv5_3": (512, 512, 28),
}  # fmt: skip
N_CLUSTERS = 64
CHANNELS = 512
_POOLED_AFTER = ("conv1_2", "conv2_2", "conv3_3", "conv4_3")
_LAST = "conv5_3"
_OWNER = "VGG16-NetVLAD"
_IMAGENET_MEAN, _IMAGENET_DEVIATION = (0.485, 0.456, 0.406), (0.229, 0.224, 0.225)
_MATLAB, _TENSORFLOW, _TORCH = "net.layers.", "vgg16_netvlad_pca/", "encoder."
_MATLAB_VLAD, _MATLAB_WHITENING = "30", "33"


class VggNetVlad(nn.Module):
    """The network: (N, 3, H, W) to unit vectors (N, dimension).

    Parameters
    ----------
    dimension : int
        Numbers kept after whitening; 32768 = not whitened.
    """

    mean: Tensor
    deviation: Tensor

    def __init__(self, dimension: int = 4096) -> None:
        super().__init__()
        self.register_buffer("mean", 255 * torch.tensor(_IMAGENET_MEAN))
        self.register_buffer("deviation", torch.ones(3))
        self.vgg = nn.ModuleDict(
            {
                name: nn.Conv2d(inputs, outputs, 3, padding=1)
                for name, (inputs, outputs, _) in VGG16_CONVOLUTIONS.items()
            }
        )
        self.vlad = NetVlad(CHANNELS, N_CLUSTERS, bias=True, normalise_input=True)
        length = CHANNELS * N_CLUSTERS
        self.whitening = nn.Linear(length, dimension) if dimension < length else None

    def forward(self, x: Tensor) -> Tensor:
        """Return unit vectors (N, dimension)."""
        vectors: Tensor = self.vlad(self.features(x))
        if self.whitening is None:
            return vectors
        return functional.normalize(self.whitening(vectors), dim=1)

    def features(self, x: Tensor) -> Tensor:
        """Return conv5_3 before its ReLU, (N, 512, H / 16, W / 16)."""
        x = (x - self.mean[:, None, None]) / self.deviation[:, None, None]
        for name, convolution in self.vgg.items():
            x = convolution(x)
            if name != _LAST:
                x = functional.relu(x)
            if name in _POOLED_AFTER:
                x = functional.max_pool2d(x, 2)
        return x

    def load_named(self, tensors: Mapping[str, Any]) -> None:
        """Take published weights.

        Raises
        ------
        InputError
            If one that is needed is missing or has another shape.
        """
        own = _own_tensors(tensors)
        if self.whitening is not None:
            own |= _first_rows(own, self.whitening.out_features)
        load_checked(self, own, _OWNER)


def _own_tensors(tensors: Mapping[str, Any]) -> dict[str, Any]:
    """Return published tensors under the network's names, with its axes."""
    if "vlad.centres" in tensors:
        return dict(tensors)
    short = {name.removeprefix("module."): tensor for name, tensor in tensors.items()}
    for prefix, convert in (
        (_MATLAB, _from_matlab), (_TENSORFLOW, _from_tensorflow), (_TORCH, _from_torch)
    ):  # fmt: skip
        if any(name.startswith(prefix) for name in short):
            return convert({name: np.asarray(tensor) for name, tensor in short.items()})
    raise InputError(
        f"weights of {_OWNER}: none of {len(tensors)} tensors is one of its; "
        "weights of another network?"
    )


def _from_matlab(arrays: Mapping[str, Any]) -> dict[str, Any]:
    def weight(layer: int | str, number: int) -> Any:
        return tensor_named(arrays, f"{_MATLAB}{layer}.weights.{number}", _OWNER)

    own: dict[str, Any] = {}
    for name, (_, _, layer) in VGG16_CONVOLUTIONS.items():
        own[f"vgg.{name}.weight"] = weight(layer, 0).transpose(3, 2, 0, 1)
        own[f"vgg.{name}.bias"] = weight(layer, 1).ravel()
    mean = tensor_named(arrays, "net.meta.normalization.averageImage", _OWNER)
    own |= _channels_last_vlad(weight(_MATLAB_VLAD, 0), weight(_MATLAB_VLAD, 1))
    own |= _channels_last_whitening(weight(_MATLAB_WHITENING, 0), weight(_MATLAB_WHITENING, 1))
    return own | _mean_colour(mean.reshape(-1, 3)[0] if mean.size != 3 else mean)


def _from_tensorflow(arrays: Mapping[str, Any]) -> dict[str, Any]:
    def weight(name: str) -> Any:
        return tensor_named(arrays, _TENSORFLOW + name, _OWNER)

    own: dict[str, Any] = {}
    for name in VGG16_CONVOLUTIONS:
        own[f"vgg.{name}.weight"] = weight(f"{name}/kernel").transpose(3, 2, 0, 1)
        own[f"vgg.{name}.bias"] = weight(f"{name}/bias")
    own |= _channels_last_vlad(weight("assignment/kernel"), weight("cluster_centers"))
    own |= _channels_last_whitening(weight("WPCA/kernel"), weight("WPCA/bias"))
    return own | _mean_colour(weight("average_rgb"))


def _from_torch(arrays: Mapping[str, Any]) -> dict[str, Any]:
    own: dict[str, Any] = {}
    for name, (_, _, layer) in VGG16_CONVOLUTIONS.items():
        for kind in ("weight", "bias"):
            own[f"vgg.{name}.{kind}"] = tensor_named(arrays, f"{_TORCH}{layer}.{kind}", _OWNER)
    own["vlad.assignment.weight"] = tensor_named(arrays, "pool.conv.weight", _OWNER)
    own["vlad.assignment.bias"] = arrays.get("pool.conv.bias", np.zeros(N_CLUSTERS, np.float32))
    own["vlad.centres"] = tensor_named(arrays, "pool.centroids", _OWNER)
    for kind in ("weight", "bias"):
        if f"WPCA.0.{kind}" in arrays:
            own[f"whitening.{kind}"] = arrays[f"WPCA.0.{kind}"]
    return own | {
        "mean": 255 * np.array(_IMAGENET_MEAN), "deviation": 255 * np.array(_IMAGENET_DEVIATION)
    }  # fmt: skip


def _channels_last_vlad(assignment: Any, centres: Any) -> dict[str, Any]:
    """Return the layer of (…, channels, clusters) arrays; what they store is added, so minus."""
    shape = (CHANNELS, N_CLUSTERS)
    if assignment.size != CHANNELS * N_CLUSTERS or centres.size != assignment.size:
        raise InputError(
            f"weights of {_OWNER}: the clusters have shapes {assignment.shape} and "
            f"{centres.shape}, expected {shape}; weights of another network?"
        )
    return {
        "vlad.assignment.weight": assignment.reshape(shape).T[:, :, None, None],
        "vlad.assignment.bias": np.zeros(N_CLUSTERS, np.float32),
        "vlad.centres": -centres.reshape(shape).T,
    }


def _channels_last_whitening(kernel: Any, bias: Any) -> dict[str, Any]:
    """Return the whitening of vectors that hold, channel by channel, the clusters."""
    if kernel.size != CHANNELS * N_CLUSTERS * bias.size:
        raise InputError(
            f"weights of {_OWNER}: the whitening has shapes {kernel.shape} and {bias.shape}, "
            f"expected {CHANNELS * N_CLUSTERS} times as many values; weights of another network?"
        )
    by_channel = kernel.reshape(CHANNELS, N_CLUSTERS, bias.size)
    by_cluster = by_channel.transpose(2, 1, 0).reshape(bias.size, -1)
    return {"whitening.weight": by_cluster, "whitening.bias": bias.ravel()}


def _mean_colour(mean: Any) -> dict[str, Any]:
    return {"mean": np.asarray(mean, np.float32).ravel(), "deviation": np.ones(3, np.float32)}


def _first_rows(own: Mapping[str, Any], count: int) -> dict[str, Any]:
    """Return the whitening's first rows: the components of largest variance."""
    names = ("whitening.weight", "whitening.bias")
    return {name: _squeezed(tensor_named(own, name, _OWNER))[:count] for name in names}


def _squeezed(tensor: Any) -> Any:
    return np.asarray(tensor).reshape(len(tensor), -1).squeeze()
