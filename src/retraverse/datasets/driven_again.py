"""A dataset whose query is driven again at another speed: a dataset of its own, with its own truth.

Its name says how: "corridor, varying speed", "corridor, with stops". The map is the recorded
drive, but for a detour, which goes through a stretch that the map must then do without. What is
drawn, and what `resample` makes of it, is in `retraverse.datasets.resample`.

Contents: `driven_again`, `find_driven`, `recorded_name`.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType

from retraverse.datasets.ground_truth import GroundTruth
from retraverse.datasets.known import Dataset, find_dataset
from retraverse.datasets.resample import PROFILES, Resampling, resample
from retraverse.errors import ConfigError
from retraverse.images import Traverse
from retraverse.registry import unknown_name

__all__ = ["driven_again", "find_driven", "recorded_name"]

_WORDS: Mapping[str, str] = MappingProxyType(
    {
        "varying": "varying speed",
        "stops": "with stops",
        "backwards": "backwards",
        "detour": "with a detour",
        "jump": "with jumps",
    }
)
"""Speed -> how a name says it; a constant speed is not mentioned."""


@dataclass(frozen=True)
class _DrivenAgain(Dataset):
    """A dataset at another speed; files, licence and tolerance are those of `recorded`."""

    recorded: Dataset = field(kw_only=True)
    speed: str = field(kw_only=True)
    seed: int = field(kw_only=True)

    @cached_property
    def _driven(self) -> tuple[Traverse, Resampling]:
        return resample(self.recorded.query(), self.speed, seed=self.seed)

    @cached_property
    def _query(self) -> Traverse:
        return self._driven[0]

    @cached_property
    def _reference(self) -> Traverse:
        reference, resampling = self.recorded.reference(), self._driven[1]
        if not len(resampling.off_map):
            return reference
        return reference.take(resampling.map_frames(self.recorded.truth()))

    @cached_property
    def _truth(self) -> GroundTruth:
        return self._driven[1].truth(self.recorded.truth())


def driven_again(dataset: Dataset, speed: str, seed: int = 0) -> Dataset:
    """Return a dataset whose query is driven again, frame by frame of the recorded one.

    Parameters
    ----------
    dataset : Dataset
    speed : str
        A name of `retraverse.datasets.PROFILES`; "constant" gives the dataset itself back.
    seed : int
        Draws where the speed changes, where it stops, leaves the map or jumps.

    Returns
    -------
    driven : Dataset
        Nothing is read yet: a drive of fewer than 10 frames is an `InputError` when it is first
        asked for, like other wrong pictures.

    Raises
    ------
    ConfigError
        If there is no such speed.
    """
    if speed not in PROFILES:
        raise ConfigError(unknown_name("speed", speed, list(PROFILES)))
    if speed == "constant":
        return dataset
    words = _WORDS[speed]
    known = replace(
        dataset.known,
        name=f"{dataset.known.name}, {words}",
        title=f"{dataset.known.title}, {words}",
        thesis_sizes=None,
    )
    return _DrivenAgain(
        known,
        dataset.query_source,
        dataset.reference_source,
        dataset.truth_file,
        dataset.position_files,
        dataset.radius_m,
        recorded=dataset,
        speed=speed,
        seed=seed,
    )


def find_driven(name: str, root: Path) -> Dataset | None:
    """Return a dataset under a data root by its name, at the speed that the name says.

    Parameters
    ----------
    name : str
        As in `find_dataset`, or the name of a `driven_again` one, seed 0.
    root : Path
        The data root.
    """
    found = find_dataset(name, root)
    recorded, speed = recorded_name(name)
    if found is not None or speed == "constant":
        return found
    dataset = find_dataset(recorded, root)
    return None if dataset is None else driven_again(dataset, speed)


def recorded_name(name: str) -> tuple[str, str]:
    """Return the name of the dataset that one was driven again from, and the speed.

    Examples
    --------
    >>> recorded_name("corridor, with stops"), recorded_name("corridor")
    (('corridor', 'stops'), ('corridor', 'constant'))
    """
    for speed, words in _WORDS.items():
        if name.endswith(f", {words}"):
            return name.removesuffix(f", {words}"), speed
    return name, "constant"
