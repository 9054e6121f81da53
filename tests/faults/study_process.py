"""A process that runs a tiny study, to be killed: ``study_process.py DATA FOLDER [CACHE]``.

With two workers that hang in place of none, to be left alone: ``study_process.py DATA hang``.
"""

import sys
from pathlib import Path

from tests.unit.studies.tiny import tiny_plan, tiny_registered

from retraverse.studies import engine
from retraverse.studies.engine import run_study

PLAN = {
    "compression": '{ levels = [10, 50, 90], pairs = ["grid"] }',
    "sequence_lengths": '["1..4"]',
}


HANGING = {**PLAN, "techniques": '[{ name = "tiny", parameters = { trouble = "hang" } }]'}


def main() -> None:
    data, folder = map(Path, sys.argv[1:3])
    if sys.argv[2] == "hang":
        with tiny_registered():
            run_study(tiny_plan(data, **HANGING), data / "study", workers=2)
        return
    # Every record is on disk at once: a kill finds some, however short the study is.
    engine.FLUSH_S = 0.0
    cache = Path(sys.argv[3]) if len(sys.argv) > 3 else None
    with tiny_registered():
        plan = tiny_plan(data, **PLAN)
        print("go", flush=True)
        result = run_study(plan, folder, workers=0, cache=cache)
    print(result.n_ok, result.n_kept, flush=True)


if __name__ == "__main__":
    main()
