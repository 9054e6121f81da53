"""Pages from templates: style and script inside, nothing fetched, every text escaped."""

import base64
import hashlib
from collections.abc import Mapping, Sequence
from functools import cache
from importlib import resources
from typing import TYPE_CHECKING, Any

from retraverse.reports import wording
from retraverse.reports.lean_svg import shared_marks

if TYPE_CHECKING:
    from jinja2 import Environment

__all__ = ["render_page"]


def render_page(
    template: str,
    context: Mapping[str, Any],
    *,
    styles: Sequence[str],
    scripts: Sequence[str],
) -> str:
    """Return a page as text.

    Parameters
    ----------
    template : str
        Name of a template of this room.
    context : mapping
        What the template draws from; `wording` is there for all of them.
    styles, scripts : sequence of str
        Names of the style sheets and scripts that go inside, in this order. The template places
        them by `style`, `script` and, for its content policy, `script_hash`.
    """
    from markupsafe import Markup

    script = "\n".join(_resource(name) for name in scripts)
    page = (
        _environment()
        .get_template(template)
        .render(
            **context,
            style=Markup("\n".join(_resource(name) for name in styles)),
            script=Markup(script),
            script_hash=base64.b64encode(hashlib.sha256(script.encode()).digest()).decode(),
        )
    )
    return shared_marks(page).lstrip()


@cache
def _environment() -> "Environment":
    """Return what renders: made once, as compiling a template takes longer than filling it."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("retraverse.reports"),
        autoescape=True,
        undefined=StrictUndefined,
    )
    environment.globals.update(wording=wording)
    environment.policies["json.dumps_kwargs"] = {"separators": (",", ":")}
    environment.filters["subscripts"] = wording.subscripts
    return environment


def _resource(name: str) -> str:
    """Return a style sheet or script without indents and lines that are only a comment."""
    text = (resources.files("retraverse.reports") / "templates" / name).read_text("utf-8")
    lines = (line.strip() for line in text.splitlines())
    return "\n".join(line for line in lines if line and not line.startswith("//"))
