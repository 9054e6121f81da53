"""What running a network through a technique costs beside running it plainly: ratios in one run.

- ONNX Runtime through a technique against the plain call on the same graph: at most 1.3, for the
  network alone, and for the whole description against the same steps written down plainly.
- A batch as `batch_size` chooses it against one by one: never slower.

    pytest benchmarks/test_learned_runtimes.py -s
"""

import os
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import onnxruntime
import pytest
from _ratios import interleaved_minimum

import retraverse as rt
from retraverse.techniques.running.onnx_runtime import export_onnx

SCALE = float(os.environ.get("RETRAVERSE_SCALE", "1"))
PICTURES = np.random.default_rng(0).integers(0, 256, (16, 240, 320, 3)).astype(np.uint8)


@pytest.fixture(scope="module")
def graph(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export_onnx(
        rt.technique("efficientnet"),  # type: ignore[arg-type]
        tmp_path_factory.mktemp("graph") / "efficientnet.onnx",
    )


@pytest.mark.parametrize("threads", [1, 2], ids=["1 thread", "2 threads"])
def test_onnx_against_the_plain_call(benchmark: Any, graph: Path, threads: int) -> None:
    technique: Any = rt.technique("efficientnet", weights=graph, threads=threads)
    prepared = technique.prepare(PICTURES[0])[None]
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads, options.inter_op_num_threads = threads, 1
    plain = onnxruntime.InferenceSession(str(graph), options, providers=["CPUExecutionProvider"])
    name = plain.get_inputs()[0].name
    run = technique.runner()
    np.testing.assert_allclose(run(prepared), plain.run(None, {name: prepared})[0], atol=1e-5)
    seconds = interleaved_minimum(
        {
            "plain": lambda: plain.run(None, {name: prepared}),
            "runner": lambda: run(prepared),
            "plain steps": lambda: plain_steps(plain, PICTURES[0]),
            "describe": lambda: technique.describe(PICTURES[0]),
        },
        rounds=40,
        least_seconds=2 * SCALE,
    )
    info = benchmark.extra_info
    info["threads"] = threads
    for call, value in seconds.items():
        info[f"{call}: ms"] = round(1e3 * value, 2)
    info["runner over plain"] = round(seconds["runner"] / seconds["plain"], 3)
    info["describe over plain steps"] = round(seconds["describe"] / seconds["plain steps"], 3)
    benchmark.pedantic(lambda: run(prepared), rounds=3)
    assert info["runner over plain"] <= 1.3
    assert info["describe over plain steps"] <= 1.3


def plain_steps(session: Any, picture: Any) -> Any:
    """Resize, normalise, run, make a unit vector: what one would write without a technique."""
    small = cv2.resize(picture, (224, 224), interpolation=cv2.INTER_AREA)
    pixels = (small.transpose(2, 0, 1)[None].astype(np.float32) - 127) / 128
    features = session.run(None, {session.get_inputs()[0].name: pixels})[0].ravel()
    return features / np.linalg.norm(features)


@pytest.mark.parametrize("runtime", ["torch", "onnx"])
def test_the_batch_chosen_is_never_slower(benchmark: Any, graph: Path, runtime: str) -> None:
    weights = {"weights": graph} if runtime == "onnx" else {}
    technique: Any = rt.technique("efficientnet", **weights)
    images = list(PICTURES)
    seconds = interleaved_minimum(
        {
            "one by one": lambda: [technique.describe(image) for image in images],
            "batches": lambda: technique.describe_batch(images),
        },
        rounds=5,
        least_seconds=2 * SCALE,
    )
    info = benchmark.extra_info
    info["batch chosen"] = technique.batch_size()
    info["batches over one by one"] = round(seconds["batches"] / seconds["one by one"], 3)
    benchmark.pedantic(lambda: technique.describe_batch(images), rounds=2)
    # Where it is 1, both sides are the same code and the ratio is the machine's noise.
    assert info["batch chosen"] == 1 or info["batches over one by one"] <= 1.05
