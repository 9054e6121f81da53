"""What a study runs: datasets x techniques x pictures x what is sent x matchers x lengths x seeds.

A plan is made from a TOML file (`load_plan`) or in Python. It is whole: datasets are found,
parameters read and ranges checked before anything runs.
"""

import itertools
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal

from retraverse.datasets.known import Dataset
from retraverse.errors import ConfigError
from retraverse.images.worsening import Worsening
from retraverse.matching import Matcher, SequenceLength
from retraverse.matching.matchers import describe_matcher
from retraverse.matching.matchers import matcher as matcher_of_name
from retraverse.techniques import Technique
from retraverse.techniques import technique as technique_of_name
from retraverse.techniques.sending import Coding

__all__ = [
    "CHUNK_FRAMES",
    "RESIZED",
    "MatcherChoice",
    "PairRule",
    "PicturePair",
    "PlanOrigin",
    "StudyPlan",
    "TechniqueChoice",
    "compression_pairs",
]

CHUNK_FRAMES = 32
"""Frames that are described as one task, and kept as one cache entry."""
RESIZED = "resized"
"""As a technique's parameter: the side the pictures were resized to (chapter 7's resolution)."""

PairRule = Literal["uniform", "query", "reference", "grid"]
"""Which c go together: the same on both sides; the query's alone, or the map's alone, beside
`other`; every c with every c."""


@dataclass(frozen=True)
class MatcherChoice:
    """A matcher, and the lengths it is asked for."""

    name: str = "mean"
    parameters: Mapping[str, Any] = field(default_factory=dict)
    """Those that are not at their defaults."""
    sequence_lengths: tuple[SequenceLength, ...] = ()
    """Empty = the technique's, else the plan's."""

    def make(self) -> Matcher:
        """Return the matcher; ConfigError if a parameter is out of range."""
        return matcher_of_name(self.name, **self.parameters)

    @property
    def label(self) -> str:
        """What records call it."""
        return describe_matcher(self.make())


@dataclass(frozen=True)
class TechniqueChoice:
    """A technique, and, if it is not run like the others, by which matchers and lengths."""

    name: str
    parameters: Mapping[str, Any] = field(default_factory=dict)
    """Those that are not at their defaults; ``"resized"`` = the side of the pictures."""
    sequence_lengths: tuple[SequenceLength, ...] = ()
    """Empty = the plan's."""
    matchers: tuple[MatcherChoice, ...] = ()
    """Empty = the plan's."""
    sent: tuple[Coding | None, ...] = ()
    """Empty = the plan's."""

    def at(self, resize: int | None) -> "TechniqueChoice":
        """Return the choice for pictures of one size.

        Raises
        ------
        ConfigError
            If a parameter is to follow the size and the pictures are not resized.
        """
        parameters = dict(self.parameters)
        for name, value in parameters.items():
            if value == RESIZED:
                if resize is None:
                    raise ConfigError(
                        f"{self.name} parameter {name!r}: got {RESIZED!r}, but the pictures are "
                        "not resized; expected images.resize in the plan, or a number"
                    )
                parameters[name] = resize
        return replace(self, parameters=parameters)

    def make(self) -> Technique:
        """Return the technique; ConfigError if a parameter is out of range."""
        return technique_of_name(self.name, **self.parameters)


@dataclass(frozen=True)
class PicturePair:
    """What is done to the pictures of the two drives."""

    query: Worsening = field(default_factory=Worsening)
    reference: Worsening = field(default_factory=Worsening)


@dataclass(frozen=True)
class PlanOrigin:
    """Where the paths of a plan's text start from."""

    root: Path
    """The plan's folder, absolute."""
    data: Path | None = None
    """The data root that was given in place of the plan's, absolute."""


@dataclass(frozen=True)
class StudyPlan:
    """Everything a study runs."""

    name: str
    """For records and titles."""
    datasets: tuple[Dataset, ...]
    techniques: tuple[TechniqueChoice, ...]
    pairs: tuple[PicturePair, ...] = (PicturePair(),)
    sent: tuple[Coding | None, ...] = (None,)
    """What travels to where the map is: the query's descriptors in some coding; None = pictures."""
    matchers: tuple[MatcherChoice, ...] = (MatcherChoice(),)
    sequence_lengths: tuple[SequenceLength, ...] = (1,)
    seeds: tuple[int, ...] = (0,)
    chapter: str = ""
    """Chapter of the thesis, "" if none."""
    entropy: bool = False
    """Whether the entropy of the query pictures is measured (figure 5.4)."""
    legibility: bool = False
    """Whether it is measured how large writing must be to be read in query pictures."""
    modules: tuple[str, ...] = ()
    """Python modules imported first: they may register techniques and matchers of one's own."""
    missing: tuple[str, ...] = ()
    """Datasets asked for that are not here; each gets a record that says so."""
    text: str = field(default="", repr=False)
    """The TOML it was read from, "" if it was made in Python."""
    origin: PlanOrigin | None = field(default=None, repr=False)
    """Where that text's paths start from."""

    def settings(
        self, technique: TechniqueChoice
    ) -> Iterator[tuple[MatcherChoice, SequenceLength]]:
        """Yield every matcher with every length that one technique is run by."""
        for chosen in technique.matchers or self.matchers:
            lengths = chosen.sequence_lengths or technique.sequence_lengths or self.sequence_lengths
            for length in lengths:
                yield chosen, length

    def sent_by(self, technique: TechniqueChoice) -> tuple[Coding | None, ...]:
        """Return what travels where one technique is run; None = pictures."""
        return technique.sent or self.sent

    @property
    def n_runs(self) -> int:
        """How many records the study gives, missing datasets not counted."""
        per_pair = sum(
            len(list(self.settings(technique))) * len(self.sent_by(technique))
            for technique in self.techniques
        )
        return len(self.datasets) * len(self.pairs) * per_pair * len(self.seeds)


def compression_pairs(
    levels: tuple[int | None, ...],
    rules: tuple[PairRule, ...] = ("uniform",),
    other: int | None = None,
) -> tuple[tuple[int | None, int | None], ...]:
    """Return the (query c, reference c) that the rules make of some levels, each once.

    Parameters
    ----------
    levels : tuple of int or None
        c, 0 to 99; None = pictures as they are.
    rules : tuple of PairRule
        Their pairs follow each other.
    other : int or None
        c of the side that "query" and "reference" leave alone.

    Examples
    --------
    >>> compression_pairs((0, 50), ("uniform", "query"), other=0)
    ((0, 0), (50, 50), (50, 0))
    """
    made = {
        "uniform": [(level, level) for level in levels],
        "query": [(level, other) for level in levels],
        "reference": [(other, level) for level in levels],
        "grid": list(itertools.product(levels, levels)),
    }
    return tuple(dict.fromkeys(pair for rule in rules for pair in made[rule]))
