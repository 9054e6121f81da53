"""The page a training leaves: its settings, its figures, its loss."""

import html
import io
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from retraverse.files import write_whole

__all__ = ["loss_curve", "smoothed", "write_training_report"]

_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
:root {{ color-scheme: light dark; }}
body {{ font: 16px/1.5 system-ui, sans-serif; max-width: 50rem; margin: 2rem auto;
  padding: 0 1rem; }}
table {{ border-collapse: collapse; }}
th, td {{ text-align: left; padding: .2rem 1rem .2rem 0; vertical-align: top;
  font-weight: normal; }}
th {{ opacity: .7; }}
svg {{ width: 100%; height: auto; background: #fefefe; }}
</style></head><body>
<h1>{title}</h1>
<p>{pictures}</p>
<h2>Loss</h2>
{curve}
<p>{n_steps} steps; faint: every batch, strong: mean of neighbouring steps.</p>
<h2>Figures</h2>{figures}
<h2>Settings</h2>{settings}
<h2>Versions</h2>{versions}
</body></html>
"""


def write_training_report(path: Path, about: Mapping[str, Any], losses: Sequence[float]) -> None:
    """Write the page: one file, nothing fetched from anywhere.

    Parameters
    ----------
    path : Path
    about : mapping
        ``training``, ``pictures``, ``settings``, ``figures``, ``versions``.
    losses : sequence of float
        One per step.
    """
    page = _PAGE.format(
        title=html.escape(str(about["training"])),
        pictures=html.escape(str(about["pictures"])),
        curve=loss_curve(losses),
        n_steps=len(losses),
        figures=_table(about["figures"]),
        settings=_table(_flat(about["settings"])),
        versions=_table(about["versions"]),
    )
    write_whole(path, page.encode())


def loss_curve(losses: Sequence[float]) -> str:
    """Return the loss over the steps as inline SVG with a text for those who cannot see it."""
    from matplotlib import style
    from matplotlib.figure import Figure

    values = np.asarray(losses, np.float64)
    steps = np.arange(1, len(values) + 1)
    with style.context(["default", {"svg.fonttype": "none", "svg.hashsalt": "retraverse"}]):
        figure = Figure(figsize=(8, 3.2), layout="constrained")
        axes = figure.add_subplot()
        axes.plot(steps, values, color="#0072b3", alpha=0.25, linewidth=0.8)
        axes.plot(steps, smoothed(values), color="#0072b3", linewidth=1.8)
        axes.set_xlabel("step")
        axes.set_ylabel("loss")
        axes.grid(color="#dde3ea")
        axes.spines[["top", "right"]].set_visible(False)
        buffer = io.StringIO()
        figure.savefig(buffer, format="svg")
    text = re.sub(r"<metadata>.*?</metadata>", "", buffer.getvalue(), flags=re.DOTALL)
    alt = f"Loss from {values[0]:.4g} at step 1 to {values[-1]:.4g} at step {len(values)}"
    return text[text.index("<svg") :].replace("<svg ", f'<svg role="img" aria-label="{alt}" ', 1)


def smoothed(values: Any) -> Any:
    """Return the mean over a fiftieth of the steps around each one, float array of its length."""
    array = np.asarray(values, np.float64)
    half = max(1, len(array) // 100)
    total = np.concatenate([[0.0], np.cumsum(array)])
    low = np.maximum(np.arange(len(array)) - half, 0)
    high = np.minimum(np.arange(len(array)) + half + 1, len(array))
    return (total[high] - total[low]) / (high - low)


def _flat(settings: Mapping[str, Any]) -> dict[str, Any]:
    """Return nested settings under names joined by a dot."""
    flat: dict[str, Any] = {}
    for name, value in settings.items():
        if isinstance(value, Mapping):
            flat |= {f"{name}.{inner}": one for inner, one in _flat(value).items()}
        else:
            flat[name] = value
    return flat


def _table(rows: Mapping[str, Any]) -> str:
    cells = "".join(
        f"<tr><th>{html.escape(str(name))}</th><td>{html.escape(_shown(value))}</td></tr>"
        for name, value in rows.items()
    )
    return f"<table>{cells}</table>"


def _shown(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
