"""Our tables of CALC, HybridNet and AlexNet against OpenCV's run of the published graphs.

Seeded weights go to both: to ours as tensors, to OpenCV's importer as a caffemodel.
"""

from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from tests.unit.weights.readers.samples import caffemodel

from retraverse.techniques.networks.caffe_net import CaffeNet, seeded_tensors
from retraverse.techniques.networks.caffe_tables import (
    ALEXNET,
    CAFFENET,
    CALC,
    SPED_NET,
    Layer,
    Shape,
    graph_of,
    until,
)
from retraverse.techniques.running.torch_runtime import torch_threads

COLOUR = (3, 227, 227)


@pytest.mark.skipif(
    not hasattr(cv2.dnn, "readNetFromCaffe"), reason="this OpenCV reads no Caffe files"
)
@pytest.mark.parametrize(
    ("file", "table", "last", "shape"),
    [
        ("calc_deploy", CALC, "relu3", (1, 120, 160)),
        ("hybridnet_deploy", SPED_NET, "relu5", COLOUR),
        ("alexnet_vpr_deploy", ALEXNET, "relu3", COLOUR),
        ("regionvlad_deploy", CAFFENET, "relu3", COLOUR),
    ],
)
def test_the_same_maps_as_opencv(
    shared: Callable[[str], Path], tmp_path: Path, file: str, table: tuple[Layer, ...], last: str,
    shape: Shape,
) -> None:  # fmt: skip
    graph = graph_of(until(table, last), shape, file)
    tensors = seeded_tensors(graph, seed=7)
    (tmp_path / "net.caffemodel").write_bytes(caffemodel(tensors))
    prototxt = _cut(shared(f"weights/prototxt/{file}.prototxt"), last, tmp_path)
    network = cv2.dnn.readNetFromCaffe(str(prototxt), str(tmp_path / "net.caffemodel"))
    pictures = np.random.default_rng(8).uniform(-1, 1, (1, *shape)).astype(np.float32)
    network.setInput(pictures)
    expected = network.forward(last)
    with torch_threads(1), torch.inference_mode():
        found = CaffeNet(graph, tensors)(torch.from_numpy(pictures)).numpy()
    assert found.shape == expected.shape
    assert np.abs(expected).max() > 0
    np.testing.assert_allclose(found, expected, atol=1e-4 * np.abs(expected).max())


def _cut(prototxt: Path, last: str, folder: Path) -> Path:
    """Return a copy of a prototxt up to a layer: OpenCV wants weights for all that it reads."""
    lines = prototxt.read_text().splitlines()
    start = next(i for i, line in enumerate(lines) if f'name: "{last}"' in line)
    end = next((i for i, line in enumerate(lines) if i > start and line.startswith("layer")), None)
    copy = folder / "net.prototxt"
    copy.write_text("\n".join(lines[:end]).replace("input_dim: 10", "input_dim: 1"))
    return copy
