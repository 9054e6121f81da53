"""Print which block and pooling of EfficientNet-Lite0 tells places apart best, as a table.

Run: .venv/bin/python benchmarks/efficientnet_blocks.py [DATA_FOLDER]
Accuracy of the windows answered, single frame and K = 10, on the real drives that are here;
tolerances as in real_sets.py. The default is chosen by the mean over stromovka and nordland_64x32
alone; the other drives are shown beside it.
"""

from collections.abc import Iterator
from typing import Any

import numpy as np
from _real_sets import RealSet, accuracy, data_folder, real_sets

import retraverse as rt
from retraverse.techniques.efficientnet import EfficientNet, EfficientNetParameters
from retraverse.techniques.summarising.pooling import pool, unit_rows
from retraverse.types import FloatArray

BLOCKS = range(2, 16)
POOLINGS = ("flat", "mean", "gem", "grid2_max", "grid2_mean", "grid4_max", "grid4_mean")
LENGTHS = (1, 10)
CHOSEN_ON = ("stromovka", "nordland_64x32")
Choice = tuple[int, str]
Row = dict[tuple[str, int], float]


def main() -> None:
    rows: dict[Choice, Row] = {(block, how): {} for block in BLOCKS for how in POOLINGS}
    names = []
    for drives in real_sets(data_folder()):
        names.append(drives.name)
        for choice, scores in all_scores(drives):
            for length in LENGTHS:
                rows[choice][drives.name, length] = accuracy(scores, drives.truth, length)
    columns = [(name, length) for name in names for length in LENGTHS]
    heads = ["block", "pooling", "values", "mean of the two"]
    print_row(heads + [f"{name}, K {length}" for name, length in columns])
    print_row(["---"] * (len(heads) + len(columns)))
    for choice in sorted(rows, key=lambda choice: -chosen_mean(rows[choice])):
        block, how = choice
        values = rt.technique("efficientnet", block=block, pooling=how).layout.dimension
        figures = [chosen_mean(rows[choice]), *(rows[choice][column] for column in columns)]
        print_row([str(block), how, str(values), *(f"{figure:.3f}" for figure in figures)])


def all_scores(drives: RealSet) -> Iterator[tuple[Choice, FloatArray]]:
    """Yield the similarity of all queries and references for every block and pooling."""
    queries, references = every_descriptor(drives.query), every_descriptor(drives.reference)
    for choice, rows in queries.items():
        yield choice, rows @ references[choice].T


def every_descriptor(traverse: rt.Traverse) -> dict[Choice, FloatArray]:
    """Return the unit vectors of every block and pooling, one run of the network a picture."""
    import torch

    torch.set_num_threads(1)
    technique = EfficientNet(EfficientNetParameters(block=max(BLOCKS)))
    blocks: Any = technique.network()._blocks
    outputs: dict[int, FloatArray] = {}
    for number in BLOCKS:
        blocks[number].register_forward_hook(
            lambda _module, _input, output, number=number: outputs.update({number: output.numpy()})
        )
    run = technique.runner()
    found: dict[Choice, list[FloatArray]] = {(b, how): [] for b in BLOCKS for how in POOLINGS}
    for frame in traverse:
        run(technique.prepare(technique.read(frame))[None])
        for block, how in found:
            found[block, how].append(unit_rows(pool(outputs[block], how))[0])
    return {choice: np.stack(rows) for choice, rows in found.items()}


def chosen_mean(row: Row) -> float:
    """Return the mean accuracy over the drives that the default is chosen on."""
    return float(np.mean([row[key] for key in row if key[0] in CHOSEN_ON] or [np.nan]))


def print_row(cells: list[str]) -> None:
    print(f"| {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
