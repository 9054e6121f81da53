"""Techniques with small published weights against published results.

- ``mobilenetv2_netvlad_tf.npz``: descriptors of eight pictures by TensorFlow from the frozen graph,
  pictures resized to 640 x 480 with OpenCV.
- Recall on Corridor (111 queries, ground truth of +-2) of the three binary networks, measured with
  the official interpreter's equal: .847, .775, .766.
"""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

import retraverse as rt

pytest.importorskip("torch", reason="the extra 'learned' is not installed")

Shared = Callable[[str], Path]
NETVLAD = "weights/mobilenetv2_netvlad"


@pytest.mark.parametrize(
    ("file", "n_pictures"),
    [("modelarch_and_weights.800.h5", 8), ("modelarch_and_weights.800.480x640x3.pb", 1)],
)
def test_mobilenet_netvlad_is_the_frozen_graph(
    shared: Shared, scaled: Callable[[int], int], file: str, n_pictures: int
) -> None:
    golden = np.load(shared("golden/mobilenetv2_netvlad_tf.npz"))
    technique = rt.technique("mobilenetv2_netvlad", weights=str(shared(f"{NETVLAD}/{file}")))
    # Both drives by turns; in the first three of the corridor one cluster is all but empty.
    chosen = [0, 4, 1, 5, 2, 6, 3, 7][: min(n_pictures, 2 * scaled(n_pictures))]
    frames = rt.open_traverse([shared(f"data/{golden['files'][number]}") for number in chosen])
    for frame, number in zip(frames, chosen, strict=True):
        found = technique.describe(technique.read(frame))["descriptor"]
        np.testing.assert_allclose(found, golden["descriptors"][number], atol=1e-4)


@pytest.mark.parametrize(
    ("name", "file", "expected"),
    [
        ("binarynet", "binaryNet", 0.847),
        ("floppynet", "floppyNet", 0.775),
        ("shallownet", "shallowNet", 0.766),
    ],
)
def test_recall_of_binary_networks_on_corridor(
    shared: Shared, scaled: Callable[[int], int], name: str, file: str, expected: float
) -> None:
    if name != "binarynet" and scaled(10) < 10:
        pytest.skip("the two smaller ones take their time: RETRAVERSE_SCALE=1 runs them")
    weights = shared(f"weights/floppynet/{file}_places365.tflite")
    technique = rt.technique(name, weights=str(weights))
    route = rt.build_map(rt.open_traverse(shared("data/corridor/reference")), technique)
    scores = rt.similarity(rt.open_traverse(shared("data/corridor/query")), route)
    truth = rt.ground_truth(shared("data/corridor/ground_truth.json"))
    matches = rt.match_similarity(scores, sequence_length=1)
    assert rt.evaluate(matches, truth).accuracy == pytest.approx(expected, abs=0.02)
