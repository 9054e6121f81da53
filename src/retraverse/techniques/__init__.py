"""Techniques: pictures in, descriptors out. One file each, one registry."""

from retraverse.techniques.base import ArraySpec, Description, Descriptions, Layout, RegionalTechnique, Technique
from retraverse.techniques.registry import ParameterInfo, TechniqueInfo, register, technique, techniques

__all__ = [
    "ArraySpec",
    "Description",
    "Descriptions",
    "Layout",
    "ParameterInfo",
    "RegionalTechnique",
    "Technique",
    "TechniqueInfo",
    "register",
    "technique",
    "techniques",
]
