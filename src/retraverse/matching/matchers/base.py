"""What a matcher is: a similarity matrix in, the reference of every window or frame out.

Conventions
- ``similarity[query, reference]``, higher is better; only its order and ratios of differences
  count: adding a number, or multiplying by a positive one, changes no answer.
- A matrix whose rows are constant holds no information: `mean` answers reference 0 (the lowest of
  equals), every other matcher "no match".
- Every matcher asks for at least `sequence_length` query and reference frames.
"""

from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

from retraverse.matching.matches import Matches
from retraverse.types import FloatArray

__all__ = ["Answer", "Matcher", "OnlineMatcher"]


@dataclass(frozen=True)
class Answer:
    """One answer of a matcher that runs frame by frame: a row of `Matches`."""

    query: int
    """The query frame it is for; frames count from 0 in the order they came."""
    reference: int
    """The reference it belongs to; -1 = "no match"."""
    score: float
    """Higher is better; what it is says the matcher."""
    sequence_length: int
    """Frames of evidence."""


class OnlineMatcher(Protocol):
    """A matcher at work on a drive that is still going on; its memory does not grow."""

    def update(self, row: FloatArray) -> Answer | None:
        """Return the answer the next query frame brings, or None where it brings none yet.

        Parameters
        ----------
        row : float array, shape (R,)
            Similarity of the frame with every reference.

        Raises
        ------
        ShapeError
            If it has another shape, or is not finite.
        """
        ...

    def finish(self) -> list[Answer]:
        """Return the answers still owed when the drive has ended."""
        ...


class Matcher(Protocol):
    """How the rows of a similarity matrix become answers."""

    name: ClassVar[str]
    """What users call it: ``"seqslam"``."""
    summary: ClassVar[str]
    """One line for lists."""
    citation: ClassVar[str]
    """Author, title, venue, year."""
    cost: ClassVar[str]
    """One line: how its time grows, and its memory beside the matrix."""
    assumes: ClassVar[str]
    """One line: what it takes for granted of the drive."""
    frame_by_frame: ClassVar[bool]
    """Whether it can answer while the drive goes on, at least with some of its parameters."""
    parameters: Any
    """A frozen dataclass."""

    def match(self, similarity: FloatArray, sequence_length: int) -> Matches:
        """Return where every window, or frame, of the query lies.

        Parameters
        ----------
        similarity : float32 array, shape (Q, R)
            Rows are queries, columns references, higher is more alike.
        sequence_length : int
            K: frames of evidence for an answer; what it means exactly says each matcher.

        Raises
        ------
        ShapeError
            If the matrix does not have two axes, or is not finite.
        ConfigError, InputError
            If K is not a whole number from 1, or a drive is shorter than a window.
        """
        ...

    def online(self, n_references: int, sequence_length: int) -> OnlineMatcher:
        """Return the matcher at work on a new drive over a map of `n_references` frames.

        Its answers are those of `match`, each as soon as its evidence has come.

        Raises
        ------
        ConfigError
            If it needs the whole drive.
        """
        ...
