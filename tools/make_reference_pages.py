"""Write the pages of docs/reference/ from the program itself, so that they cannot drift."""

import subprocess
import sys
from pathlib import Path

import retraverse as rt
from retraverse.cli.main import VERBS

OUT = Path(__file__).resolve().parents[1] / "docs" / "reference"


def commands_page() -> str:
    """Return every verb's help, as the program prints it."""
    parts = ["# Command line\n", "Every verb, as `--help` prints it.\n"]
    for verb in ("", *VERBS):
        words = ["retraverse", *verb.split()]
        code = "from retraverse.cli.main import run; run()"
        shown = subprocess.run(
            [sys.executable, "-c", code, *words[1:], "--help"],
            capture_output=True, text=True, check=True,
            env={"COLUMNS": "96", "TERM": "dumb", "PATH": ""},
        ).stdout.replace("Usage: -c", "Usage: retraverse")  # fmt: skip
        parts.append(f"## {' '.join(words)}\n\n```text\n{shown.strip()}\n```\n")
    return "\n".join(parts)


def techniques_page() -> str:
    """Return the registry as tables: what each technique is, costs and can be told."""
    parts = ["# Techniques\n"]
    for info in rt.techniques():
        layout = rt.technique(info.name).layout
        parts.append(f"## {info.name}\n\n{info.summary}. {info.citation}.\n")
        parts.append(
            f"Descriptor: {layout.kind}, {layout.dimension:,} values, "
            f"{layout.descriptor.n_bytes / 1024:.1f} KB a frame with the defaults.\n"
        )
        parts.append("| parameter | default | choices | meaning |\n|---|---|---|---|")
        for item in info.parameters:
            choices = ", ".join(f"`{choice}`" for choice in item.choices)
            parts.append(f"| `{item.name}` | `{item.default}` | {choices} | {item.help} |")
        parts.append("")
    return "\n".join(parts)


def python_page() -> str:
    """Return the public interface, each name drawn from its docstring."""
    names = [name for name in rt.__all__ if not name.startswith("_")]
    homes = [(name, getattr(rt, name).__module__) for name in names]
    return "# Python\n\n" + "\n".join(f"::: {home}.{name}\n" for name, home in homes)


def main() -> None:
    """Write all pages."""
    OUT.mkdir(parents=True, exist_ok=True)
    pages = {"commands": commands_page, "techniques": techniques_page, "python": python_page}
    for name, make in pages.items():
        (OUT / f"{name}.md").write_text(make(), encoding="utf-8")


if __name__ == "__main__":
    main()
