"""Every classic learned technique with seeded weights, at a size that tests can afford."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch
from safetensors.numpy import save_file

from retraverse.techniques.networks import caffe_tables as tables
from retraverse.techniques.networks.binary_alexnet import BinaryAlexNet
from retraverse.techniques.networks.caffe_net import seeded_tensors
from retraverse.techniques.networks.mobilenet_netvlad import MobileNetNetVlad
from retraverse.techniques.networks.vgg_netvlad import VggNetVlad
from retraverse.types import Array

__all__ = ["SMALL", "seeded_parameters", "state_of"]

Tensors = dict[str, Array]
COLOUR = (3, 227, 227)


def state_of(make: Callable[[], torch.nn.Module], seed: int = 0) -> Tensors:
    """Return the state of a seeded network that tells pictures apart.

    Convolutions are scaled so that values neither vanish nor grow (He et al., ICCV 2015), but for
    the binary first one; normalisations are not trivial.
    """
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(seed)
        network = make()
        for module in network.modules():
            if isinstance(module, torch.nn.Conv2d) and module.kernel_size != (11, 11):
                torch.nn.init.kaiming_normal_(module.weight)
            if isinstance(module, torch.nn.BatchNorm2d):
                assert module.running_mean is not None
                assert module.running_var is not None
                module.running_mean.uniform_(-0.2, 0.2)
                module.running_var.uniform_(0.5, 1.5)
    return {name: value.numpy() for name, value in network.state_dict().items()}


def _caffe(table: tuple[tables.Layer, ...], last: str, shape: tables.Shape) -> Tensors:
    graph = tables.graph_of(tables.until(table, last), shape, "seeded")
    return seeded_tensors(graph, seed=1)


def _regionvlad() -> Tensors:
    tensors = _caffe(tables.CAFFENET, "relu3", COLOUR)
    # Random maps are positive nearly everywhere, one region each; trained ones are sparse.
    return {**tensors, "conv3.1": tensors["conv3.1"] - 80}


MAKERS: dict[str, Callable[[], Tensors]] = {
    "alexnet": lambda: _caffe(tables.ALEXNET, "relu3", COLOUR),
    "amosnet": lambda: _caffe(tables.SPED_NET, "relu5", COLOUR),
    "binarynet": lambda: state_of(lambda: BinaryAlexNet("binarynet")),
    "calc": lambda: _caffe(tables.CALC, "relu3", (1, 120, 160)),
    "floppynet": lambda: state_of(lambda: BinaryAlexNet("floppynet")),
    "hybridnet": lambda: _caffe(tables.SPED_NET, "relu5", COLOUR),
    "mobilenetv2_netvlad": lambda: state_of(MobileNetNetVlad),
    "netvlad": lambda: state_of(lambda: VggNetVlad(16)),
    "regionvlad": _regionvlad,
    "shallownet": lambda: state_of(lambda: BinaryAlexNet("shallownet")),
}
"""Technique -> its seeded weights."""

SMALL: dict[str, dict[str, Any]] = {
    "alexnet": {"projection": 48},
    "amosnet": {"mean": "colour"},
    "hybridnet": {"mean": "colour"},
    "mobilenetv2_netvlad": {"width": 80, "height": 64},
    "netvlad": {"dimension": 16, "width": 64, "height": 48},
    "regionvlad": {"words": 8},
}
"""Technique -> parameters that keep it small, or need no other file."""


def seeded_parameters(name: str, folder: Path) -> dict[str, Any]:
    """Return parameters of a technique under which it runs with seeded weights."""
    path = folder / f"{name}.safetensors"
    save_file({key: np.ascontiguousarray(value) for key, value in MAKERS[name]().items()}, path)
    parameters = {"weights": str(path), "batch": 2, **SMALL.get(name, {})}
    if name == "regionvlad":
        centres = np.random.default_rng(2).uniform(0, 40, (8, 384)).astype(np.float32)
        save_file({"centres": centres}, folder / "words.safetensors")
        parameters["vocabulary"] = str(folder / "words.safetensors")
    return parameters
