"""Techniques: pictures in, descriptors out. One file each, one registry.

A new technique is one file in this room: a class with the members of `Technique`, a frozen
dataclass of parameters, and `register` above it. Nothing else needs to know.

What several of them share has rooms of its own: `preparing` (pictures for networks), `running`
(weights, batches, runtimes), `networks` (what is run), `handmade` (gradients, filters, entropy)
and `summarising` (pooling, projection, unit vectors).
"""

import sys
from types import ModuleType

from retraverse.techniques.base import (
    ArraySpec,
    BatchTechnique,
    Description,
    Descriptions,
    FingerprintedTechnique,
    Layout,
    RegionalTechnique,
    Technique,
)
from retraverse.techniques.from_callable import technique_from_callable
from retraverse.techniques.registry import (
    ParameterInfo,
    TechniqueInfo,
    register,
    technique,
    techniques,
)

__all__ = [
    "ArraySpec",
    "BatchTechnique",
    "Description",
    "Descriptions",
    "FingerprintedTechnique",
    "Layout",
    "ParameterInfo",
    "RegionalTechnique",
    "Technique",
    "TechniqueInfo",
    "register",
    "technique",
    "technique_from_callable",
    "techniques",
]


class _CallableRoom(ModuleType):
    """The room itself, callable: ``retraverse.techniques`` is a room and the verb that lists it.

    Importing the room puts the module where the package's top promises the function.
    """

    def __call__(self) -> list[TechniqueInfo]:
        return techniques()


sys.modules[__name__].__class__ = _CallableRoom
