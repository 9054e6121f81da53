"""Measure how well a technique holds as one thing after another grows worse.

Renders a street once undisturbed and once disturbed at rising strength, locates the second drive
on the first, and prints the accuracy. The pictures are simulated: the numbers compare strengths
and techniques with each other and say nothing about any real road.

    python examples/simulated_route.py
    python examples/simulated_route.py --frames 60 --technique cohog
"""

# ruff: noqa: T201 -- printing is what an example is for
import argparse

import retraverse as rt
from retraverse.datasets.simulated import Disturbances, simulate_route

RADIUS_M = 4.0
STRENGTHS = (0.0, 0.25, 0.5, 0.75, 1.0)


def accuracy(disturbances: Disturbances, options: argparse.Namespace) -> float:
    """Return which part of a disturbed drive's windows is located within 4 m."""
    route = simulate_route(options.seed, options.frames, query=disturbances)
    query, reference = rt.open_traverse(route.query), rt.open_traverse(route.reference)
    truth = rt.from_positions(
        route.query.positions_m, route.reference.positions_m, radius_m=RADIUS_M
    )
    route_map = rt.build_map(reference, rt.technique(options.technique))
    matches = rt.match(query, route_map, sequence_length=options.window)
    return rt.evaluate(matches, truth).accuracy


def main() -> None:
    """Print one line for every strength."""
    parser = argparse.ArgumentParser(description="accuracy at rising disturbance")
    parser.add_argument("--frames", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--technique", default="hog")
    parser.add_argument("--window", type=int, default=1, help="frames matched together")
    parser.add_argument("--steps", type=int, default=len(STRENGTHS), help="strengths tried")
    options = parser.parse_args()
    print(f"{options.technique}, windows of {options.window}: right within {RADIUS_M:g} m")
    print("strength  lateral_shift  night")
    for strength in STRENGTHS[: options.steps]:
        shifted = accuracy(Disturbances(lateral_shift=strength), options)
        dark = accuracy(Disturbances(night=strength), options)
        print(f"{strength:8.2f}  {shifted:13.1%}  {dark:5.1%}")


if __name__ == "__main__":
    main()
