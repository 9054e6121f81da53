"""A technique that costs nothing and fails on demand, a dataset of noise, and plans over both."""

import os
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np

from retraverse.images import Frame
from retraverse.studies.keeping.records import RunRecord
from retraverse.studies.plans.plan import StudyPlan
from retraverse.studies.plans.plan_file import read_plan
from retraverse.techniques import ArraySpec, Description, Descriptions, Layout
from retraverse.techniques import registry as technique_registry
from retraverse.techniques.summarising.vectors import cosine_similarity
from retraverse.types import FloatArray, ImageArray

ROOT = Path(__file__).resolve().parents[3]
MODULE = "tests.unit.studies.register_tiny"
MARK = 255
"""Grey level of the upper left pixel of the picture that the technique cannot stand."""
DEATH_NOTE = "RETRAVERSE_TEST_DEATH_NOTE"
"""Names a file; the worker that removes it dies. Those that hang leave one beside it."""
HANG_S = 40


@dataclass(frozen=True)
class TinyParameters:
    """What goes wrong."""

    trouble: Literal["none", "raise", "die", "always die", "hang"] = "none"
    side: int = 6


class Tiny:
    """The picture at `side` x `side`, less its mean."""

    name: ClassVar[str] = "tiny"
    summary: ClassVar[str] = "for tests"
    citation: ClassVar[str] = "none"
    version: ClassVar[int] = 1

    def __init__(self, parameters: TinyParameters | None = None) -> None:
        self.parameters: Any = parameters or TinyParameters()
        shape = (self.parameters.side**2,)
        self.layout = Layout("global", {"descriptor": ArraySpec(shape, "float32")})

    def read(self, frame: Frame) -> ImageArray:
        return frame.grey()

    def describe(self, image: ImageArray) -> Description:
        import cv2

        self._suffer(image)
        side = self.parameters.side
        small = np.asarray(cv2.resize(image, (side, side)), np.float32).ravel()
        small -= small.mean()
        return {"descriptor": small / max(float(np.linalg.norm(small)), 1e-6)}

    def similarity(self, queries: Descriptions, references: Descriptions) -> FloatArray:
        return cosine_similarity(queries, references, non_negative=False)

    def _suffer(self, image: ImageArray) -> None:
        if self.parameters.trouble == "always die":
            os.kill(os.getpid(), signal.SIGKILL)
        if self.parameters.trouble == "raise" and image[0, 0] == MARK:
            raise ValueError("a picture\nit cannot stand")
        note = Path(os.environ.get(DEATH_NOTE, "none"))
        if self.parameters.trouble == "hang":
            note.with_name(f"{note.name} {os.getpid()}").touch()
            time.sleep(HANG_S)
        if self.parameters.trouble == "die" and note.exists():
            note.unlink(missing_ok=True)
            os.kill(os.getpid(), signal.SIGKILL)


@contextmanager
def tiny_registered() -> Iterator[None]:
    """Let plans import the technique; afterwards it is as if it had never been."""
    sys.path.insert(0, str(ROOT))
    try:
        yield
    finally:
        sys.path.remove(str(ROOT))
        sys.modules.pop(MODULE, None)
        technique_registry._registry._entries.pop("tiny", None)


def write_dataset(folder: Path, *, n_frames: int = 12, seed: int = 0, marked: int = -1) -> Path:
    """Write two drives of noise along one route; picture `marked` of the query bears the mark."""
    import cv2

    rng = np.random.default_rng(seed)
    for drive in ("query", "reference"):
        (folder / drive).mkdir(parents=True, exist_ok=True)
    for index in range(n_frames):
        place = rng.integers(0, 200, (24, 32), np.uint8)
        for drive in ("query", "reference"):
            picture = place + rng.integers(0, 50, place.shape, np.uint8)
            if drive == "query" and index == marked:
                picture[0, 0] = MARK
            cv2.imwrite(str(folder / drive / f"{index:03d}.png"), picture)
    return folder


def tiny_plan(data: Path, **changes: str) -> StudyPlan:
    """Return a plan over the datasets in `data`; `changes` are lines of TOML by key."""
    return read_plan(tiny_text(data, **changes))


def tiny_text(data: Path, **changes: str) -> str:
    lines = {
        "name": '"tiny study"',
        "data": f'"{data}"',
        "datasets": '["noise"]',
        "techniques": '["tiny"]',
        "sequence_lengths": '["1..3"]',
        "modules": f'["{MODULE}"]',
        "compression": '{ levels = [50, 90], pairs = ["grid"] }',
        **changes,
    }
    return "\n".join(f"{key} = {value}" for key, value in lines.items())


def hashes(records: tuple[RunRecord, ...]) -> dict[str, str]:
    """Return what must be the same whoever runs a study and however often it was interrupted."""
    return {record.run_id: record.content_hash() for record in records}


def wait_for(happened: Callable[[], bool], *, seconds: float) -> None:
    """Wait until something has happened, for so long at most."""
    until = time.monotonic() + seconds
    while not happened():
        assert time.monotonic() < until, "it did not happen in time"
        time.sleep(0.005)
