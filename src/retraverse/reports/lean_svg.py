"""matplotlib's SVG in a fifth of its bytes: the same picture to a twentieth of a unit.

What is left out is what a page does not need: decimals, groups without meaning, the style that
every mark repeats, clip paths that cut nothing. Ticks become one path for each axis, marks keep one
definition each, named by their shape, so that a page can share it among its figures.
"""

import hashlib
import re
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterable, Sequence

from markupsafe import escape

from retraverse.reports.path_data import (
    Segment,
    moved,
    number_text,
    path_text,
    points_of,
    read_path,
)
from retraverse.reports.svg_nodes import HUNDREDTHS, TENTHS, Node, bundled, style_text, written

__all__ = ["lean_svg", "shared_marks"]

_HREF = "{http://www.w3.org/1999/xlink}href"
_ROOT_STYLE = "font:11px DejaVu Sans;stroke-linejoin:round"
"""What `svg_nodes.USUAL` takes for granted."""
_ORDER = ("path", "text")
"""Parts of an axis in the order they are drawn: lines and ticks, then what stands beside."""
_MARK = re.compile(r'<path id="(m[0-9a-v]{7})" d="[^"]*"/>')


def lean_svg(text: str, alt: str) -> str:
    """Return a drawing of matplotlib as inline SVG with `alt` as its accessible name.

    Parameters
    ----------
    text : str
        The SVG file's text.
    alt : str
        What it shows.

    Notes
    -----
    A group with an id "layer-x" becomes one of that class; other ids stay only where they are used.
    """
    root = ET.fromstring(re.sub(r"[\x00-\x08\x0b\x0c\x0e-\x1f]", "", text))
    drawing = _Drawing(root)
    content = "".join(map(written, bundled(drawing.nodes(root))))
    definitions = "".join(drawing.definitions(content))
    return (
        f'<svg viewBox="{root.get("viewBox")}" role="img" aria-label="{escape(alt)}" '
        f'style="{_ROOT_STYLE}"><defs>{definitions}</defs>{content}</svg>'
    ).replace("<defs></defs>", "")


def shared_marks(page: str) -> str:
    """Return a page in which every shape of a mark is defined once, where it comes first."""
    known: set[str] = set()

    def first(found: re.Match[str]) -> str:
        is_new = found[1] not in known
        known.add(found[1])
        return found[0] if is_new else ""

    return _MARK.sub(first, page).replace("<defs></defs>", "")


class _Drawing:
    """A drawing of matplotlib, to be read piece by piece."""

    def __init__(self, root: ET.Element) -> None:
        defined = [item for defs in root.iter() if _tag(defs) == "defs" for item in defs]
        self._defined = {item.get("id", ""): item for item in defined}
        self._shapes = {
            name: read_path(item.get("d", ""))
            for name, item in self._defined.items()
            if _tag(item) == "path"
        }
        self._n_uses = Counter(item.get(_HREF, "#")[1:] for item in root.iter())
        self._clips = {
            name: _rectangle(item[0])
            for name, item in self._defined.items()
            if _tag(item) == "clipPath"
        }
        self._marks: dict[str, str] = {}

    def definitions(self, content: str) -> list[str]:
        """Return what the content refers to: shapes of marks, clip paths, hatches."""
        used = set(re.findall(r"url\(#([^)]+)\)", content))
        others = (item for name, item in self._defined.items() if name in used)
        return [
            *(f'<path id="{name}" d="{d}"/>' for d, name in self._marks.items()),
            *(written(self._plain(item)) for item in others),
        ]

    def _plain(self, element: ET.Element) -> Node:
        """Return a definition as it is, but for its numbers."""
        node = Node(_tag(element), dict(element.attrib), _style_of(element))
        node.attributes.pop("style", None)
        if node.tag == "path":
            node.path = read_path(node.attributes.pop("d"))
        node.children = [self._plain(child) for child in element]
        return node

    def nodes(self, element: ET.Element, *, is_axis: bool = False) -> list[Node]:
        """Return what one element draws, without groups that mean nothing."""
        tag = _tag(element)
        if tag == "svg":
            return [node for child in element for node in self.nodes(child)]
        if tag == "g":
            return self._group(element, is_axis=is_axis)
        if tag in ("path", "use"):
            node = self._path(element) if tag == "path" else self._use(element, is_axis=is_axis)
            return [self._clipped(node)] if _is_visible(node) else []
        if tag == "text":
            return [_text(element)]
        return [self._picture(element)] if tag == "image" else []

    def _group(self, element: ET.Element, *, is_axis: bool) -> list[Node]:
        name = element.get("id", "")
        begins_axis = name.startswith("matplotlib.axis")
        inside = [
            node for child in element for node in self.nodes(child, is_axis=is_axis or begins_axis)
        ]
        if begins_axis:
            inside = _axis(inside)
        attributes = {"class": name} if name.startswith("layer-") else {}
        if clip := element.get("clip-path"):
            attributes["clip-path"] = clip
        if not (attributes and inside):
            return inside
        group = self._clipped(Node("g", attributes, children=inside))
        return [group] if group.attributes else inside

    def _path(self, element: ET.Element) -> Node:
        attributes = {name: value for name in ("clip-path",) if (value := element.get(name))}
        return Node("path", attributes, _style_of(element), read_path(element.get("d", "")))

    def _use(self, element: ET.Element, *, is_axis: bool) -> Node:
        """Return a mark; one of an axis, or that is used but once, as a path in its place."""
        name = element.get(_HREF, "#")[1:]
        x, y = (float(element.get(side, "0")) for side in ("x", "y"))
        style = _style_of(self._defined[name]) | _style_of(element)
        shape = self._shapes[name]
        if is_axis or self._n_uses[name] == 1:
            return Node("path", {}, style, moved(shape, x, y))
        return Node("use", {"href": f"#{self._mark(shape)}"}, style, shape, (x, y))

    def _mark(self, shape: Sequence[Segment]) -> str:
        """Return the name of a shape, which follows from the shape alone."""
        d = path_text(shape, HUNDREDTHS)
        if d not in self._marks:
            number = int(hashlib.sha256(d.encode()).hexdigest()[:10], 16)
            self._marks[d] = "m" + "".join(
                "0123456789abcdefghijklmnopqrstuv"[number >> 5 * at & 31] for at in range(7)
            )
        return self._marks[d]

    def _picture(self, element: ET.Element) -> Node:
        attributes = {name.rpartition("}")[2]: value for name, value in element.attrib.items()}
        attributes["href"] = re.sub(r"\s", "", attributes["href"])
        name = attributes.pop("id", "")
        if name.startswith("layer-"):
            attributes["class"] = name
        return self._clipped(Node("image", attributes))

    def _clipped(self, node: Node) -> Node:
        """Drop a clip path that all of a node lies within."""
        clip = node.attributes.get("clip-path", "")
        if clip and node.tag != "image":
            low_x, low_y, high_x, high_y = self._clips[clip[5:-1]]
            if all(low_x <= x <= high_x and low_y <= y <= high_y for x, y in _places(node)):
                del node.attributes["clip-path"]
        return node


def _tag(element: ET.Element) -> str:
    return element.tag.rpartition("}")[2]


def _rectangle(element: ET.Element) -> tuple[float, float, float, float]:
    """Return left, top, right and bottom with a little room for rounding."""
    x, y, width, height = (float(element.get(side, "0")) for side in ("x", "y", "width", "height"))
    return x - 0.05, y - 0.05, x + width + 0.05, y + height + 0.05


def _style_of(element: ET.Element) -> dict[str, str]:
    pairs = (part.partition(":") for part in element.get("style", "").split(";"))
    return {name.strip(): value.strip() for name, _, value in pairs if value}


def _text(element: ET.Element) -> Node:
    at = float(element.get("x", "0")), float(element.get("y", "0"))
    turned = re.match(r"rotate\((-?[\d.]+)", element.get("transform", ""))
    angle = float(turned[1]) if turned else 0
    x, y = (number_text(round(TENTHS * value), TENTHS) for value in at)
    attributes = {"transform": f"rotate({angle:g} {x} {y})"} if angle else {}
    return Node("text", attributes, _style_of(element), at=at, text=element.text or "")


def _is_visible(node: Node) -> bool:
    return node.style.get("fill") != "none" or node.style.get("stroke", "none") != "none"


def _places(node: Node) -> Iterable[tuple[float, float]]:
    if node.tag == "path":
        return points_of(node.path)
    return (
        [node.at] if node.tag != "g" else [at for child in node.children for at in _places(child)]
    )


def _axis(nodes: Sequence[Node]) -> list[Node]:
    """Return an axis with all lines of one style as one path, then its texts."""
    found: dict[str, Node] = {}
    for node in nodes:
        if node.tag == "path" and not node.attributes:
            drawn = {key: value for key, value in node.style.items() if key != "fill"}
            key = style_text(drawn)
            before = found.setdefault(key, Node("path", {}, node.style | {"fill": "none"}))
            before.path += node.path
        else:
            found[str(id(node))] = node
    return sorted(found.values(), key=lambda node: _ORDER.index(node.tag))
