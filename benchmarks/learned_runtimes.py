"""Print t_e of every learned technique under every runtime, and what int8 loses, as two tables.

Run: .venv/bin/python benchmarks/learned_runtimes.py [DATA_FOLDER]
One run, one thread inside the network; the fastest of several rounds in which all runtimes of a
technique take turns. t_e is the whole of `describe` on a picture of 1024 x 384: resizing, network,
pooling, normalising. Techniques whose weights are not here are named and left out.
"""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from _ratios import interleaved_minimum
from _real_sets import RealSet, accuracy, data_folder, real_sets

import retraverse as rt
from retraverse.errors import RetraverseError
from retraverse.images import Frame
from retraverse.techniques.running.learned import LearnedTechnique
from retraverse.techniques.running.quantise import quantise

BATCHES = (4, 16)
LENGTHS = (1, 10)
FILES = {
    "binarynet": "floppynet/binaryNet_places365.tflite",
    "floppynet": "floppynet/floppyNet_places365.tflite",
    "mobilenetv2_netvlad": "mobilenetv2_netvlad/modelarch_and_weights.800.h5",
    "shallownet": "floppynet/shallowNet_places365.tflite",
    "squeezenet": "squeezenet/squeezenet_v1.0.npz",
}
"""Weights that no package brings, where they lie beside the data."""


def main() -> None:
    runnable = {name: made for name in all_learned() if (made := in_float(name))}
    with tempfile.TemporaryDirectory() as folder:
        print_times(runnable, Path(folder))
        print_losses(runnable, Path(folder))


def all_learned() -> list[str]:
    infos = rt.techniques()
    return [info.name for info in infos if "runtime" in {p.name for p in info.parameters}]


def in_float(name: str, **parameters: Any) -> LearnedTechnique | None:
    """Return a technique whose weights are here, else None; says which are not."""
    file = data_folder().parent / "weights" / FILES.get(name, "none")
    given = {"weights": file} if file.is_file() else {}
    made = rt.technique(name, **given, **parameters)
    try:
        made.fingerprint()  # type: ignore[attr-defined]
    except RetraverseError:
        print(f"left out {name}: its weights are not here")
        return None
    return made if isinstance(made, LearnedTechnique) else None


def in_int8(made: LearnedTechnique, frames: Any, path: Path) -> LearnedTechnique:
    """Return the technique in 8-bit integers, its ranges fixed by `frames`."""
    print(f"{made.name}, {quantise(made, frames, path)}")
    return rt.technique(made.name, weights=path)  # type: ignore[return-value]


def print_times(runnable: dict[str, LearnedTechnique], folder: Path) -> None:
    random = np.random.default_rng(0)
    coarse = random.integers(0, 256, (16, 24, 64, 3)).astype(np.uint8)
    images = [np.kron(one, np.ones((16, 16, 1), np.uint8)) for one in coarse]
    frames = [Frame.from_array(image, name=str(row)) for row, image in enumerate(images)]
    rows = []
    for name, made in runnable.items():
        kinds = {
            "torch": made,
            "onnx": in_float(name, runtime="onnx"),
            "int8": in_int8(made, frames, folder / f"{name}_times.onnx"),
        }
        calls: dict[str, Any] = {}
        for kind, one in kinds.items():
            assert one is not None
            calls[kind] = lambda one=one: one.describe(images[0])
            for size in BATCHES:
                calls[f"{kind}, {size}"] = lambda one=one, size=size: at_once(one, images[:size])
        best = interleaved_minimum(calls, rounds=3, least_seconds=5)
        for kind, one in kinds.items():
            figures = [best[kind], *(best[f"{kind}, {size}"] / size for size in BATCHES)]
            cells = [name, kind, *(f"{1e3 * figure:.1f}" for figure in figures)]
            rows.append([*cells, str(one.batch_size())])  # type: ignore[union-attr]
    print()
    print_row(["technique", "runtime", "t_e, ms"] + [f"in {n}s, ms" for n in BATCHES] + ["chosen"])
    print_row(["---"] * (4 + len(BATCHES)))
    for row in rows:
        print_row(row)


def at_once(made: LearnedTechnique, images: list[Any]) -> Any:
    """Run a batch whatever size the technique would choose."""
    return made.finish(made.runner()(np.stack([made.prepare(image) for image in images])))


def print_losses(runnable: dict[str, LearnedTechnique], folder: Path) -> None:
    print()
    print_row(["technique", "drives", "", *(f"accuracy, K = {length}" for length in LENGTHS)])
    print_row(["---"] * (3 + len(LENGTHS)))
    for drives in real_sets(data_folder()):
        if drives.name not in ("corridor", "stromovka"):
            continue
        for name in runnable:
            made = in_float(name, runtime="onnx")
            assert made is not None
            small = in_int8(made, drives.reference, folder / f"{name}_{drives.name}.onnx")
            for kind, one in (("float", made), ("int8", small)):
                print_row([name, drives.name, kind, *(f"{x:.3f}" for x in found(one, drives))])


def found(made: LearnedTechnique, drives: RealSet) -> list[float]:
    """Return the accuracy at every sequence length."""
    route = rt.build_map(drives.reference, made)
    scores = rt.similarity(drives.query, route)
    return [accuracy(scores, drives.truth, length) for length in LENGTHS]


def print_row(cells: list[str]) -> None:
    print(f"| {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
