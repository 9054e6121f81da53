"""A street that does not exist, driven through twice, with the truth known exactly.

`simulate_route` renders a reference and a query drive of one procedurally made street in
perspective: houses, trees, parked cars, markings. `Disturbances` makes the query differ by
season, night, traffic, weather, viewpoint and motion, each from 0 to 1, so that what breaks a
technique can be measured one cause at a time. The same seed gives the same street.
"""

from retraverse.datasets.simulated.camera import Camera
from retraverse.datasets.simulated.conditions import Disturbances
from retraverse.datasets.simulated.drive import (
    SimulatedDrive,
    SimulatedRoute,
    simulate_route,
)
from retraverse.datasets.simulated.motion import (
    Leg,
    Motion,
    MotionKind,
    MotionProfile,
    plan_motion,
)
from retraverse.datasets.simulated.street import Street, make_street
from retraverse.datasets.simulated.write import write_drive

__all__ = [
    "Camera",
    "Disturbances",
    "Leg",
    "Motion",
    "MotionKind",
    "MotionProfile",
    "SimulatedDrive",
    "SimulatedRoute",
    "Street",
    "make_street",
    "plan_motion",
    "simulate_route",
    "write_drive",
]
