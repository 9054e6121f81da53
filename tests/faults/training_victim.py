"""Trains in children that are killed with SIGKILL; run by test_training_kill.py.

Forking after PyTorch has trained a little spares its seconds of imports for every life. Arguments:
folder, seed. Prints one JSON line: kills, lives that found a checkpoint, the last losses and the
weights.
"""

import json
import os
import random
import signal
import sys
import tempfile
import time
from dataclasses import replace
from pathlib import Path

from tests.unit.training.tiny import QUICK, Line

from retraverse.files import write_whole
from retraverse.training.loop import CHECKPOINT, LoopSettings, run_loop

SETTINGS = LoopSettings(
    steps=120, learning_rate=QUICK.learning_rate, threads=1, checkpoint_every=1,
    half_precision=False, averaging=0.9,
)  # fmt: skip


def live(folder: Path) -> None:
    result = run_loop(Line(), SETTINGS, folder, resume=True)
    weights = [value for one in result.network.parameters() for value in one.flatten().tolist()]
    said = {"first_step": result.first_step, "weights": weights, "losses": result.losses[-3:]}
    write_whole(folder / "result.json", json.dumps(said).encode())


def main() -> None:
    folder, seed = Path(sys.argv[1]), int(sys.argv[2])
    dice = random.Random(seed)
    n_kills = n_resumed = 0
    with tempfile.TemporaryDirectory() as warm:
        run_loop(Line(), replace(SETTINGS, steps=2), Path(warm))
    while not (folder / "result.json").exists():
        before = (folder / CHECKPOINT).exists()
        child = os.fork()
        if child == 0:
            live(folder)
            os._exit(0)
        if n_kills < 5:
            # The first may die before it did anything, the others have something to go on from.
            end = time.monotonic() + 60
            while n_kills and not (folder / CHECKPOINT).exists() and time.monotonic() < end:
                time.sleep(0.001)
            time.sleep(dice.uniform(0.001, 0.05))
            os.kill(child, signal.SIGKILL)
            n_kills += 1
            n_resumed += before
        os.waitpid(child, 0)
    result = json.loads((folder / "result.json").read_text())
    print(json.dumps({**result, "n_kills": n_kills, "n_resumed": n_resumed}))


if __name__ == "__main__":
    main()
