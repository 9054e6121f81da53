"""`retraverse techniques`, `retraverse matchers`: what there is, with parameters and defaults."""

from collections.abc import Sequence

from retraverse.cli.options import JsonOutput
from retraverse.cli.output import print_json, print_table
from retraverse.matching.matchers import MatcherInfo
from retraverse.matching.matchers import matchers as all_matchers
from retraverse.techniques import ParameterInfo, TechniqueInfo
from retraverse.techniques import techniques as all_techniques

__all__ = ["matchers", "techniques"]


def techniques(json_output: JsonOutput = False) -> None:
    """List the techniques and their parameters."""
    if json_output:
        print_json([{**_as_dict(info), "version": info.version} for info in all_techniques()])
        return
    for info in all_techniques():
        print(f"{info.name}: {info.summary}\n  {info.citation}")
        _print_parameters(info.parameters)


def matchers(json_output: JsonOutput = False) -> None:
    """List the matchers, what each costs and assumes, and their parameters."""
    if json_output:
        print_json([{**_as_dict(info), **_promises(info)} for info in all_matchers()])
        return
    for info in all_matchers():
        print(f"{info.name}: {info.summary}\n  {info.citation}")
        for what, promise in _promises(info).items():
            print(f"  {what.replace('_', ' ')}: {_word(promise)}")
        _print_parameters(info.parameters)


def _promises(info: MatcherInfo) -> dict[str, object]:
    return {
        "assumes": info.assumes,
        "cost": info.cost,
        "frame_by_frame": info.frame_by_frame,
    }


def _word(promise: object) -> str:
    return ("yes" if promise else "no") if isinstance(promise, bool) else str(promise)


def _print_parameters(parameters: Sequence[ParameterInfo]) -> None:
    rows = [[f"  {item.name}", _values(item), item.help] for item in parameters]
    if rows:
        print_table(rows, head=("  parameter", "default", "meaning"))
    print()


def _as_dict(info: TechniqueInfo | MatcherInfo) -> dict[str, object]:
    return {
        "name": info.name,
        "summary": info.summary,
        "citation": info.citation,
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
