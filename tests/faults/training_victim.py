"""Trains in children that are killed with SIGKILL; run by test_training_kill.py.

Forking after PyTorch is imported spares its second of import for every life. Arguments: folder,
seed. Prints one JSON line: kills, lives that found a checkpoint, the last losses and the weights.
"""

import json
import os
import random
import signal
import sys
import time
from pathlib import Path

from tests.unit.training.tiny import QUICK, Line

from retraverse.training.loop import CHECKPOINT, LoopSettings, run_loop

SETTINGS = LoopSettings(
    steps=120, learning_rate=QUICK.learning_rate, threads=1, checkpoint_every=1,
    half_precision=False, averaging=0.9,
)  # fmt: skip


def live(folder: Path) -> None:
    result = run_loop(Line(), SETTINGS, folder, resume=True)
    weights = [value for one in result.network.parameters() for value in one.flatten().tolist()]
    said = {"first_step": result.first_step, "weights": weights, "losses": result.losses[-3:]}
    (folder / "result.json").write_text(json.dumps(said))


def main() -> None:
    folder, seed = Path(sys.argv[1]), int(sys.argv[2])
    dice = random.Random(seed)
    n_kills = n_resumed = 0
    while not (folder / "result.json").exists():
        before = (folder / CHECKPOINT).exists()
        child = os.fork()
        if child == 0:
            live(folder)
            os._exit(0)
        if n_kills < 5:
            time.sleep(dice.uniform(0.01, 0.15))
            os.kill(child, signal.SIGKILL)
            n_kills += 1
            n_resumed += before
        os.waitpid(child, 0)
    result = json.loads((folder / "result.json").read_text())
    print(json.dumps({**result, "n_kills": n_kills, "n_resumed": n_resumed}))


if __name__ == "__main__":
    main()
