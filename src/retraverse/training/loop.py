"""One loop for every training: seeded, and after a kill at any instant it goes on where it was.

Conventions
- What happens at a step depends on the state before it, the seed and the step's number alone: a
  task draws its batch from ``np.random.default_rng([seed, step])``, and PyTorch's own generator is
  seeded at each step. So a checkpoint holds no place in a data set, and a resumed run does what
  an uninterrupted one does.
- A checkpoint is one file, written whole: weights, averaged weights, optimiser, losses, step.
- Losses are those of single batches, one per step.

References
----------
Loshchilov, Hutter: SGDR: Stochastic Gradient Descent with Warm Restarts, ICLR 2017, equation 5
(one period, no restart); Polyak, Juditsky: Acceleration of Stochastic Approximation by Averaging,
1992 (here with exponential weights).
"""

import copy
import io
import json
import math
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Protocol

import numpy as np
import torch
from torch import Tensor, nn

from retraverse.errors import ConfigError, InputError
from retraverse.files import write_whole
from retraverse.types import Progress, no_progress

__all__ = [
    "CHECKPOINT",
    "LoopSettings",
    "Task",
    "Trained",
    "generator_of_step",
    "learning_rate_at",
    "run_loop",
]

CHECKPOINT = "checkpoint.pt"
"""Name of the checkpoint in the folder of a training."""
_FORMAT = 1


@dataclass(frozen=True)
class LoopSettings:
    """How long and how fast."""

    steps: int = 1000
    """Updates of the weights."""
    learning_rate: float = 1e-3
    """Of AdamW at its highest, after the warm-up; falls to 0 along half a cosine."""
    warm_up: int = 50
    """Steps over which the learning rate rises from 0."""
    weight_decay: float = 1e-4
    """Of AdamW."""
    largest_gradient: float = 1.0
    """Longer gradients are shortened to this norm."""
    averaging: float = 0.0
    """The result is the running mean of the weights, which keeps this share of itself at every
    step; 0 = the last weights."""
    checkpoint_every: int = 100
    """Steps between checkpoints."""
    threads: int = 2
    """Threads of PyTorch."""
    half_precision: bool = True
    """Whether products are bfloat16 where the processor has them; weights stay float32."""
    seed: int = 0
    """Same seed, same training."""

    def __post_init__(self) -> None:
        """Check every range."""
        _check("steps", self.steps, self.steps >= 1, "at least 1")
        _check("learning_rate", self.learning_rate, self.learning_rate > 0, "more than 0")
        _check("warm_up", self.warm_up, self.warm_up >= 0, "0 or more")
        _check("weight_decay", self.weight_decay, self.weight_decay >= 0, "0 or more")
        _check("largest_gradient", self.largest_gradient, self.largest_gradient > 0, "more than 0")
        _check("averaging", self.averaging, 0 <= self.averaging < 1, "0 to below 1")
        _check("checkpoint_every", self.checkpoint_every, self.checkpoint_every >= 1, "at least 1")
        _check("threads", self.threads, 1 <= self.threads <= 256, "1 to 256")
        _check("seed", self.seed, self.seed >= 0, "0 or more")


class Task(Protocol):
    """What is trained: the loop asks for nothing else."""

    @property
    def network(self) -> nn.Module:
        """What learns: its parameters that require gradients."""
        ...

    def batch(self, step: int, random: np.random.Generator) -> Any:
        """Return the batch of a step, drawn by `random`; may be called in another thread."""
        ...

    def loss(self, batch: Any) -> Tensor:
        """Return the loss of a batch, one number."""
        ...

    def identity(self) -> dict[str, Any]:
        """Return what must be the same for a checkpoint to be continued, as plain values."""
        ...


@dataclass(frozen=True)
class Trained:
    """What a training came to."""

    network: nn.Module
    """In evaluation mode, with the averaged weights where the settings ask for them."""
    losses: tuple[float, ...]
    """One per step."""
    first_step: int
    """0, or where a checkpoint was taken up."""


def run_loop(
    task: Task,
    settings: LoopSettings,
    folder: Path,
    *,
    resume: bool = False,
    progress: Progress = no_progress,
) -> Trained:
    """Train, with a checkpoint in `folder` every so many steps and at the end.

    Parameters
    ----------
    task : Task
    settings : LoopSettings
    folder : Path
        Holds the checkpoint; must exist.
    resume : bool
        Go on from the checkpoint there, if there is one.
    progress : Progress
        Shows the steps.

    Raises
    ------
    InputError
        If there is a checkpoint and `resume` is not set, or it is damaged or of another training;
        if the loss is no longer a number.
    """
    state = _LoopState(task.network, settings)
    first = _take_up(state, task, settings, folder / CHECKPOINT, resume)
    task.network.train()
    with _threads(settings.threads):
        steps = range(first, settings.steps)
        batches = _batches(task, settings, steps)
        for step, batch in progress(batches, total=len(steps), label="training"):
            _one_step(state, task, settings, step, batch)
            if (step + 1) % settings.checkpoint_every == 0 or step + 1 == settings.steps:
                _write(state, task, settings, folder / CHECKPOINT)
    return Trained(state.averaged.eval(), tuple(state.losses), first)


def generator_of_step(seed: int, step: int) -> np.random.Generator:
    """Return the random numbers of one step."""
    return np.random.default_rng([seed, step])


def learning_rate_at(settings: LoopSettings, step: int) -> float:
    """Return the learning rate of a step, counted from 0."""
    rising = min(1.0, (step + 1) / (settings.warm_up + 1))
    falling = 0.5 * (1 + math.cos(math.pi * step / settings.steps))
    return settings.learning_rate * rising * falling


class _LoopState:
    """All that changes from step to step."""

    def __init__(self, network: nn.Module, settings: LoopSettings) -> None:
        self.network = network
        self.averaged = copy.deepcopy(network) if settings.averaging else network
        self.learning = [one for one in network.parameters() if one.requires_grad]
        if not self.learning:
            raise ConfigError("nothing to train: every weight of the network is frozen")
        self.optimiser = torch.optim.AdamW(
            self.learning, lr=settings.learning_rate, weight_decay=settings.weight_decay
        )
        self.losses: list[float] = []


def _batches(task: Task, settings: LoopSettings, steps: range) -> Iterator[tuple[int, Any]]:
    """Yield (step, batch); the next batch is made while one is learned from."""

    def make(step: int) -> Any:
        return task.batch(step, generator_of_step(settings.seed, step))

    with ThreadPoolExecutor(max_workers=1) as maker:
        coming = maker.submit(make, steps.start) if steps else None
        for step in steps:
            assert coming is not None
            batch = coming.result()
            coming = maker.submit(make, step + 1) if step + 1 < steps.stop else None
            yield step, batch


def _one_step(state: _LoopState, task: Task, settings: LoopSettings, step: int, batch: Any) -> None:
    torch.manual_seed(settings.seed * 1_000_003 + step)
    for group in state.optimiser.param_groups:
        group["lr"] = learning_rate_at(settings, step)
    with torch.autocast("cpu", torch.bfloat16, enabled=settings.half_precision):
        loss = task.loss(batch)
    value = float(loss.detach())
    if not math.isfinite(value):
        raise InputError(
            f"the loss is {value} at step {step + 1}: training has diverged; expected a finite "
            f"number (learning rate {settings.learning_rate} too high, or pictures of one colour?)"
        )
    state.optimiser.zero_grad()
    loss.backward()  # type: ignore[no-untyped-call]
    torch.nn.utils.clip_grad_norm_(state.learning, settings.largest_gradient)
    state.optimiser.step()
    state.losses.append(value)
    _average(state, settings, step)


@torch.no_grad()
def _average(state: _LoopState, settings: LoopSettings, step: int) -> None:
    """Move the averaged weights; in the first steps they follow faster."""
    if not settings.averaging:
        return
    kept = min(settings.averaging, (step + 1) / (step + 10))
    for average, now in zip(state.averaged.parameters(), state.network.parameters(), strict=True):
        average.lerp_(now, 1 - kept)
    buffers = zip(state.averaged.buffers(), state.network.buffers(), strict=True)
    for buffer, latest in buffers:
        buffer.copy_(latest)


def _identity(task: Task, settings: LoopSettings) -> str:
    """Return what a checkpoint must agree in, as text; threads and checkpoints may change."""
    loop = asdict(settings)
    for name in ("checkpoint_every", "threads"):
        del loop[name]
    return json.dumps({"task": task.identity(), "loop": loop}, sort_keys=True)


def _write(state: _LoopState, task: Task, settings: LoopSettings, path: Path) -> None:
    content = {
        "format": _FORMAT,
        "identity": _identity(task, settings),
        "network": state.network.state_dict(),
        "averaged": state.averaged.state_dict() if settings.averaging else {},
        "optimiser": state.optimiser.state_dict(),
        "losses": torch.tensor(state.losses, dtype=torch.float64),
    }
    buffer = io.BytesIO()
    torch.save(content, buffer)
    write_whole(path, buffer.getvalue())


def _take_up(
    state: _LoopState, task: Task, settings: LoopSettings, path: Path, resume: bool
) -> int:
    """Load the checkpoint if there is one; return the step to go on with."""
    if not path.exists():
        return 0
    if not resume:
        raise InputError(
            f"{path}: a training was begun here; expected an empty folder (resume it, or choose "
            "another one)"
        )
    content = _read(path)
    theirs, ours = content["identity"], _identity(task, settings)
    if theirs != ours:
        raise InputError(f"{path}: begun with other settings: {_difference(theirs, ours)}")
    state.network.load_state_dict(content["network"])
    if settings.averaging:
        state.averaged.load_state_dict(content["averaged"])
    state.optimiser.load_state_dict(content["optimiser"])
    state.losses = content["losses"].tolist()
    return len(state.losses)


def _read(path: Path) -> dict[str, Any]:
    """Return a checkpoint; nothing in the file is executed."""
    try:
        content = torch.load(path, weights_only=True)
        if content["format"] == _FORMAT:
            return dict(content)
    except Exception as error:  # PyTorch raises anything on damaged files
        raise InputError(f"{path}: no checkpoint that can be read, or a damaged one") from error
    raise InputError(f"{path}: a checkpoint of another version of this program")


def _difference(theirs: str, ours: str) -> str:
    """Return the first settings in which two identities differ."""
    old, new = _flat(json.loads(theirs)), _flat(json.loads(ours))
    names = [name for name in sorted({*old, *new}) if old.get(name) != new.get(name)]
    return ", ".join(f"{name} was {old.get(name)!r}, now {new.get(name)!r}" for name in names[:3])


def _flat(nested: dict[str, Any]) -> dict[str, Any]:
    return {name: value for part in nested.values() for name, value in part.items()}


@contextmanager
def _threads(count: int) -> Iterator[None]:
    """Give PyTorch so many threads while the block lasts."""
    before = torch.get_num_threads()
    torch.set_num_threads(count)
    try:
        yield
    finally:
        torch.set_num_threads(before)


def _check(name: str, value: float, good: bool, expected: str) -> None:
    if not good or not math.isfinite(value):
        raise ConfigError(f"{name}: got {value}, expected {expected}")
