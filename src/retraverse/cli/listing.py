"""`retraverse techniques`: what there is, with every parameter and its default."""

from retraverse.cli.options import JsonOutput
from retraverse.cli.output import print_json, print_table
from retraverse.techniques import ParameterInfo
from retraverse.techniques import techniques as all_techniques

__all__ = ["techniques"]


def techniques(json_output: JsonOutput = False) -> None:
    """List the techniques and their parameters."""
    if json_output:
        print_json([_as_dict(info.name) for info in all_techniques()])
        return
    for info in all_techniques():
        print(f"{info.name}: {info.summary}\n  {info.citation}")
        rows = [[f"  {item.name}", _values(item), item.help] for item in info.parameters]
        print_table(rows, head=("  parameter", "default", "meaning"))
        print()


def _as_dict(name: str) -> dict[str, object]:
    info = next(item for item in all_techniques() if item.name == name)
    return {
        "name": info.name,
        "summary": info.summary,
        "citation": info.citation,
        "version": info.version,
        "parameters": [
            {
                "name": item.name,
                "default": item.default,
                "choices": list(item.choices),
                "help": item.help,
            }
            for item in info.parameters
        ],
    }


def _values(parameter: ParameterInfo) -> str:
    others = [str(choice) for choice in parameter.choices if choice != parameter.default]
    return " | ".join([str(parameter.default), *others])
