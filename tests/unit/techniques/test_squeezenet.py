from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from skimage import data
from tests.unit.techniques.tiny_network import pictures

import retraverse as rt
from retraverse.errors import ConfigError, DataMissingError
from retraverse.techniques.networks.squeezenet import SqueezeNet as Network
from retraverse.techniques.running.torch_runtime import torch_threads
from retraverse.techniques.squeezenet import SqueezeNet, SqueezeNetParameters
from retraverse.weights.store import load_tensors

CAT, ESPRESSO = 285, 967


@pytest.fixture(params=["squeezenet_v1.0.npz", "squeezenet_v1.0.caffemodel"])
def weights(request: pytest.FixtureRequest, shared: Callable[[str], Path]) -> Path:
    return shared(f"weights/squeezenet/{request.param}")


def test_prepared_as_its_weights_want_it_names_what_it_sees(weights: Path) -> None:
    technique = SqueezeNet(SqueezeNetParameters(weights=str(weights)))
    network = Network(head=True).eval()
    network.load_named(load_tensors(technique.weights_path()).tensors)
    photographs: list[Any] = [data.chelsea(), data.coffee()]  # type: ignore[no-untyped-call]
    shown = np.stack([technique.prepare(photograph) for photograph in photographs])
    with torch_threads(1), torch.inference_mode():
        classes = network(torch.from_numpy(shown)).argmax(1)
    assert classes.tolist() == [CAT, ESPRESSO]


@pytest.mark.parametrize("fire", [2, 5, 9])
def test_the_layout_is_known_before_the_network_is(
    fire: int, shared: Callable[[str], Path]
) -> None:
    weights = shared("weights/squeezenet/squeezenet_v1.0.npz")
    technique = rt.technique("squeezenet", weights=weights, fire=fire)
    described = technique.describe(pictures(1)[0])["descriptor"]
    assert described.shape == technique.layout.descriptor.shape


def test_weights_not_here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("RETRAVERSE_WEIGHTS", str(tmp_path))
    with pytest.raises(DataMissingError, match="retraverse weights get squeezenet"):
        SqueezeNet().describe(pictures(1)[0])


def test_ranges() -> None:
    with pytest.raises(ConfigError, match="squeezenet fire: got 1, expected 2 to 9"):
        SqueezeNetParameters(fire=1)
