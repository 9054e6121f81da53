"""The elements of a lean drawing, and how they are written: style said once for neighbours."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from itertools import groupby

from markupsafe import escape

from retraverse.reports.path_data import Segment, number_text, path_text

__all__ = ["HUNDREDTHS", "TENTHS", "USUAL", "Node", "bundled", "style_text", "written"]

USUAL = {
    "font-family": "'DejaVu Sans'",
    "font-size": "11px",
    "stroke-linejoin": "round",
    "stroke-linecap": "butt",
}
"""Style of most elements, said once for the whole drawing."""
TENTHS, HUNDREDTHS = 10, 100
"""Steps of a unit that places, and shapes of marks, are rounded to."""


@dataclass
class Node:
    """One element of the lean drawing."""

    tag: str
    attributes: dict[str, str] = field(default_factory=dict)
    style: dict[str, str] = field(default_factory=dict)
    path: tuple[Segment, ...] = ()
    """What a path draws, or the shape of the mark that is used."""
    at: tuple[float, float] = (0, 0)
    """Where a mark or a text is."""
    text: str = ""
    children: list["Node"] = field(default_factory=list)


def bundled(nodes: Iterable[Node]) -> list[Node]:
    """Return nodes, what neighbours of one style have in common said by a group around them."""
    bundles = []
    for (_, style), items in groupby(nodes, key=_kind):
        some = list(items)
        for node in some:
            node.children = bundled(node.children)
        if len(some) > 1 and style:
            shared = Node("g", {}, some[0].style, children=some)
            for node in some:
                node.style = {}
            some = [shared]
        bundles += some
    return [_unnested(node) for node in bundles]


def _kind(node: Node) -> tuple[str, str]:
    return node.tag, style_text(node.style)


def _unnested(node: Node) -> Node:
    """Return a group of one child as that child, where they say different things."""
    if node.tag != "g" or len(node.children) != 1:
        return node
    (child,) = node.children
    if set(node.attributes) & set(child.attributes) or (node.style and child.style):
        return node
    if "clip-path" in node.attributes and "transform" in child.attributes:
        return node  # On the child itself the clip path would be moved along.
    child.attributes = node.attributes | child.attributes
    child.style = child.style or node.style
    return child


def style_text(style: Mapping[str, str]) -> str:
    """Return a style as an attribute's text, without what is usual."""
    return ";".join(f"{name}:{value}" for name, value in style.items() if USUAL.get(name) != value)


def written(node: Node) -> str:
    """Return an element as text."""
    attributes = dict(node.attributes)
    if node.tag == "path":
        attributes["d"] = path_text(node.path, TENTHS)
    if node.tag in ("use", "text"):
        for name, value in zip("xy", node.at, strict=True):
            attributes[name] = number_text(round(TENTHS * value), TENTHS)
    if style := style_text(node.style):
        attributes["style"] = style
    head = node.tag + "".join(f' {name}="{escape(value)}"' for name, value in attributes.items())
    inside = str(escape(node.text)) + "".join(map(written, node.children))
    return f"<{head}>{inside}</{node.tag}>" if inside else f"<{head}/>"
