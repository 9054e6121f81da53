"""Lets benchmarks import the helpers beside them, and prints all ratios as a table at the end."""

import sys
from pathlib import Path
from typing import Any

sys.path.insert(0, str(Path(__file__).parent))


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Print one row for every ratio that the benchmarks of this run have found."""
    session = getattr(terminalreporter.config, "_benchmarksession", None)
    rows = [
        (benchmark.name, f"{benchmark.stats.min * 1e3:.3f}", str(name), str(value))
        for benchmark in getattr(session, "benchmarks", ())
        for name, value in benchmark.extra_info.items()
    ]
    if rows:
        terminalreporter.write_line(
            "\n| benchmark | best, ms | figure | value |\n|---|---|---|---|"
        )
    for row in rows:
        terminalreporter.write_line(f"| {' | '.join(row)} |")
