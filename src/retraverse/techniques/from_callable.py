"""Any Python function from a picture to a vector as a technique.

A map cannot hold a function. It holds the name, the version and the settings that the function was
given, and is opened with the same function again::

    mine = rt.technique_from_callable(describe, name="mine", version=1)
    rt.build_map(reference, mine, path="route.map")
    route = rt.load_map("route.map", technique=mine)
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

import numpy as np
import numpy.typing as npt

from retraverse.errors import ConfigError, InputError
from retraverse.images import Frame
from retraverse.techniques.base import ArraySpec, Description, Descriptions, Layout, Technique
from retraverse.techniques.parameters import parameter
from retraverse.techniques.registry import CALLABLE_PREFIX
from retraverse.techniques.summarising.vectors import cosine_similarity, unit_vector
from retraverse.types import FloatArray, ImageArray

__all__ = ["CallableParameters", "technique_from_callable"]

Function = Callable[[ImageArray], npt.ArrayLike]
Measure = Callable[[FloatArray, FloatArray], npt.ArrayLike]
_PROBE = (240, 320)
"""Height and width of the picture that shows how long the vectors are."""


@dataclass(frozen=True)
class CallableParameters:
    """What a map records of a function: what it is given, and what its user says of it."""

    picture: Literal["colour", "grey"] = parameter("colour", "what the function is given")
    settings: str = parameter("", "what else it depends on, in the user's words; compared")


class _CallableTechnique:
    """A function that wears the members of a technique."""

    name: ClassVar[str]
    summary: ClassVar[str]
    citation: ClassVar[str]
    version: ClassVar[int]

    def __init__(
        self,
        function: Function,
        parameters: CallableParameters,
        dimension: int | None,
        measure: Measure | None,
    ) -> None:
        self.parameters = parameters
        self._function = function
        self._measure = measure
        shape = (dimension or self._length(),)
        self.layout = Layout("global", {"descriptor": ArraySpec(shape, "float32")})

    def _length(self) -> int:
        """Return how long the function's vectors are: it is given a picture of noise."""
        shape = _PROBE if self.parameters.picture == "grey" else (*_PROBE, 3)
        probe = np.random.default_rng(0).integers(0, 256, shape).astype(np.uint8)
        return len(self._vector(probe))

    def read(self, frame: Frame) -> ImageArray:
        """Return the picture, in colour (RGB) or grey."""
        return frame.grey() if self.parameters.picture == "grey" else frame.colour()

    def describe(self, image: ImageArray) -> Description:
        """Return the function's vector: of length 1, unless it comes with its own measure.

        Raises
        ------
        InputError
            If what it gives is no vector of finite numbers, or of another length than before.
        """
        vector = self._vector(image)
        expected = self.layout.dimension
        if len(vector) != expected:
            raise InputError(
                f"{self.name}: got {len(vector)} numbers, expected {expected} as before"
            )
        return {"descriptor": vector if self._measure else unit_vector(vector)}

    def similarity(self, queries: Descriptions, references: Descriptions) -> FloatArray:
        """Return the cosine of every pair, or what the user's own measure says."""
        if self._measure is None:
            return cosine_similarity(queries, references, non_negative=False)
        scores = np.asarray(self._measure(queries.descriptor, references.descriptor), np.float32)
        expected = (len(queries), len(references))
        if scores.shape != expected:
            raise InputError(
                f"{self.name}: its similarity gave shape {scores.shape}, expected {expected}: "
                "queries, references"
            )
        return scores

    def _vector(self, image: ImageArray) -> FloatArray:
        given = self._function(image)
        try:
            vector = np.ascontiguousarray(given, np.float32).ravel()
        except (ValueError, TypeError) as error:
            raise InputError(
                f"{self.name}: the function gave {type(given).__name__}, expected numbers"
            ) from error
        if not vector.size or not np.isfinite(vector).all():
            raise InputError(
                f"{self.name}: the function gave {vector.size} numbers, not all of them finite; "
                "expected a vector"
            )
        return vector


def technique_from_callable(
    function: Function,
    *,
    name: str,
    version: int = 1,
    picture: Literal["colour", "grey"] = "colour",
    dimension: int | None = None,
    similarity: Measure | None = None,
    settings: str = "",
    citation: str = "a function of yours, unpublished",
) -> Technique:
    """Return a technique that asks a Python function for its descriptors.

    Parameters
    ----------
    function : callable
        Given one picture, uint8 (H, W, 3) RGB or (H, W) grey, of whatever size; returns a vector,
        or an array that is flattened. Called from several threads at once.
    name : str
        What maps and reports call it, after ``callable:``.
    version : int >= 1
        Raise it whenever the function gives other vectors: maps of another version are refused.
    picture : {"colour", "grey"}
    dimension : int, optional
        Length of the vector. Default: found with a picture of noise, 240 x 320.
    similarity : callable, optional
        Given float32 (Q, D) and (R, D), returns (Q, R), higher is more alike. Vectors are then
        kept as they are. Default: the cosine.
    settings : str
        What else the vectors depend on, such as a checkpoint's name; recorded and compared.
    citation : str
        Author, title, venue, year.

    Raises
    ------
    ConfigError
        If the name, version or picture makes no sense.

    Examples
    --------
    >>> mine = technique_from_callable(lambda image: image.mean((0, 1)), name="mean colour")
    >>> mine.layout.dimension
    3
    """
    if not callable(function):
        raise ConfigError(f"function: got {type(function).__name__}, expected a callable")
    if not name or not name.isprintable():
        raise ConfigError(f"name of a technique: got {name!r}, expected printable text")
    if isinstance(version, bool) or not isinstance(version, int) or version < 1:
        raise ConfigError(f"version of {name!r}: got {version!r}, expected a whole number from 1")
    if picture not in ("colour", "grey"):
        raise ConfigError(f"picture of {name!r}: got {picture!r}, expected 'colour' or 'grey'")
    members: dict[str, Any] = {
        "name": CALLABLE_PREFIX + name,
        "summary": f"the Python function {getattr(function, '__name__', name)}",
        "citation": citation,
        "version": version,
    }
    wearer = type("CallableTechnique", (_CallableTechnique,), members)
    made: Technique = wearer(function, CallableParameters(picture, settings), dimension, similarity)
    return made
