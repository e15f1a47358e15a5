"""Tasks at Stonehenge: eleven flights and five drives, and twenty flights for experiments."""

import math
from dataclasses import replace

from nerfnav.world import Task

_FLIGHTS = tuple(
    Task(name, start, goal)
    for name, start, goal in [
        ("East to west", (0.55, -0.02, 0.05), (-0.72, 0.17, 0.19)),
        ("South to north", (-0.12, -0.92, 0.05), (-0.1, 0.8, 0.19)),
        ("South-west to north-east", (-0.72, -0.75, 0.1), (0.51, 0.48, 0.16)),
        ("Through the horseshoe", (-0.42, -0.75, 0.1), (0.21, 0.48, 0.16)),
        ("Past the altar", (-0.12, -0.75, 0.1), (-0.09, 0.48, 0.16)),
        ("South to north-west", (0.18, -0.75, 0.1), (-0.39, 0.48, 0.16)),
        ("Corner to corner", (0.48, -0.75, 0.1), (-0.69, 0.48, 0.16)),
        ("South-east to north-west", (0.48, -0.42, 0.1), (-0.71, 0.83, 0.16)),
        ("West to the entrance", (-0.72, -0.12, 0.1), (0.49, 0.83, 0.16)),
        ("Along the horseshoe", (-0.72, -0.42, 0.1), (0.49, 0.23, 0.16)),
        ("Headline, across the ring", (0.39, -0.67, 0.2), (-0.4, 0.55, 0.16)),
    ]
)
"""The ten flights of the paper's authors and the one of their headline figure."""

_LOWEST = 0.1
"""Height that starts of flights have at least [m]: that of eight of the authors' ten. The other two are 5 cm up, and
the first step's noise of 2 cm, which no action can answer, drives one in 17 flights from there into the grass."""
_FLOWN = tuple(replace(task, start=(*task.start[:2], max(_LOWEST, task.start[2]))) for task in _FLIGHTS)

_DRIVES = tuple(
    Task(name, (*start[:2], 0.07), (*goal[:2], 0.07), start[2], goal[2], "diffdrive")
    for name, start, goal in [  # x, y, yaw at both ends
        ("Drive past the altar", (-0.12, -0.75, math.pi / 2), (-0.09, 0.55, math.pi / 2)),
        ("Drive into the horseshoe", (0.6, 0.48, -2.4), (0.15, 0.3, 3.1)),
        ("Drive along the avenue", (0.62, 0.74, -2.3), (0.2, 0.55, 3.1)),
        ("Drive around the western trilithon", (-0.72, -0.42, 1.6), (-0.55, 0.5, 0.8)),
        ("Drive from south to east", (-0.42, -0.75, 0.0), (0.55, -0.02, 1.6)),
    ]
)
"""The same for a robot on two wheels, whose underside is 3 cm above the highest grass."""

TASKS = _FLOWN + _DRIVES

EXPERIMENT_TASKS = _FLIGHTS[:10] + tuple(
    Task(name, start, goal)
    for name, start, goal in [
        ("Under the eastern lintel", (1.02, -0.64, 0.12), (0.48, -0.42, 0.1)),
        ("Under the northern lintel", (-0.1, 0.48, 0.16), (0.04, 1.2, 0.15)),
        ("On top of the western lintel", (-0.72, -0.12, 0.1), (-0.95, 0.2, 0.52)),
        ("Down from the great trilithon", (-0.22, -0.28, 0.67), (0.18, -0.75, 0.1)),
        ("Up to the middle of the ring", (-0.72, 0.17, 0.12), (0.05, 0.2, 0.6)),
        ("High in, down behind the trilithon", (1.1, 0.6, 0.6), (-0.5, 0.5, 0.12)),
        ("Past the bluestone", (1.2, 0.17, 0.12), (0.5, 0.1, 0.3)),
        ("Outside to outside", (1.17, -0.25, 0.12), (0.05, 1.12, 0.2)),
        ("Over the stump and up", (-1.15, -0.7, 0.12), (0.0, 0.1, 0.55)),
        ("From north to south, sinking", (0.3, 1.1, 0.5), (-0.3, -1.1, 0.15)),
    ]
)
"""The ten flights of the paper's authors as they have them, and ten more that change height or pass the ring."""
