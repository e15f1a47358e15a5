"""Tasks in the church: ten flights, five couches that must turn, five drives."""

import math

from nerfnav.world import Task

_FLIGHTS = [
    ("Down the nave", (-1.15, 0.0, 0.2), (0.9, 0.0, 0.3)),
    ("Aisle to aisle", (-0.4, -0.62, 0.15), (0.0, 0.62, 0.25)),
    ("Over the screen", (0.28, 0.12, 0.55), (0.9, -0.2, 0.15)),
    ("From the altar to the door", (0.92, 0.25, 0.25), (-1.18, 0.1, 0.45)),
    ("Through the arcade, up to the ties", (-0.8, -0.62, 0.2), (-0.4, 0.1, 0.55)),
    ("Down from the ridge", (0.0, 0.0, 0.85), (-0.8, 0.62, 0.15)),
    ("Above the ties", (-1.2, 0.05, 0.82), (0.82, 0.1, 0.8)),
    ("Between the pews", (-0.746, 0.28, 0.13), (-0.346, -0.28, 0.13)),
    ("Aisle to chancel", (0.35, -0.62, 0.2), (0.9, -0.45, 0.2)),
    ("Down along the aisle", (-1.2, -0.62, 0.48), (0.4, -0.62, 0.2)),
]
_ACROSS = math.pi / 2
_COUCH = 0.08
"""Height of a couch's middle [m]: its underside is 3 cm above the floor, clear of the haze."""
_COUCHES = [  # x, y, yaw at both ends
    ("Turn, and through the rood screen", (0.27, 0.0, _ACROSS), (0.88, 0.0, _ACROSS)),
    ("Up the nave and through the screen", (-0.2, 0.0, 0.0), (0.78, -0.3, _ACROSS)),
    ("From pew to pew", (-0.746, 0.26, _ACROSS), (-0.346, -0.26, _ACROSS)),
    ("Out of the pews into the chancel", (-0.346, 0.26, _ACROSS), (0.8, 0.25, _ACROSS)),
    ("From the aisle before the screen", (-0.4, -0.62, 0.0), (0.3, 0.1, _ACROSS)),
]
_CART = 0.07
"""The same for a differential drive [m]."""
_DRIVES = [
    ("Up the nave", (-1.15, 0.0, 0.0), (0.3, 0.0, 0.0)),
    ("Through the rood screen", (0.15, 0.0, 0.0), (0.88, 0.0, 0.0)),
    ("From the aisle to the screen", (-0.4, -0.62, 0.0), (0.3, 0.1, 0.0)),
    ("Along the northern aisle", (-0.95, 0.61, 0.0), (0.3, 0.62, 0.0)),
    ("Around the font", (-1.22, -0.55, 0.0), (-1.15, 0.06, _ACROSS)),
]
TASKS = (
    *(Task(name, start, goal) for name, start, goal in _FLIGHTS),
    *(
        Task(name, (*start[:2], height), (*goal[:2], height), start[2], goal[2], robot)
        for robot, height, ways in (("couch", _COUCH, _COUCHES), ("diffdrive", _CART, _DRIVES))
        for name, start, goal in ways
    ),
)
