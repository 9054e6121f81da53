"""Small pictures of simulated drives, each look of a street made once for all tests."""

from collections.abc import Callable

import pytest

from retraverse.datasets.simulated import Camera, Disturbances, SimulatedRoute, simulate_route
from retraverse.types import ImageArray

SMALL = Camera(width=96, height=72, supersampling=1)


@pytest.fixture(scope="session")
def small_route() -> Callable[..., SimulatedRoute]:
    """Return a function that simulates a route of 24 small frames; strengths are keywords."""
    routes: dict[object, SimulatedRoute] = {}

    def make(seed: int = 1, **strengths: float) -> SimulatedRoute:
        key = (seed, *sorted(strengths.items()))
        if key not in routes:
            query = Disturbances(**strengths)
            routes[key] = simulate_route(seed, 24, query=query, camera=SMALL)
        return routes[key]

    return make


@pytest.fixture(scope="session")
def picture(small_route: Callable[..., SimulatedRoute]) -> Callable[..., ImageArray]:
    """Return a function that renders the middle frame of a query drive as float32."""

    def render(**strengths: float) -> ImageArray:
        return small_route(**strengths).query[12].astype("float32")

    return render
