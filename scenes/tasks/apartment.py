"""Tasks in the apartment: ten flights of a 25 cm quadrotor, three moves of a sofa, five drives."""

import math

from nerfnav.world import Task

_FLIGHTS = [
    ("From the sofa to the stove", (-1.6, -1.2, 1.2), (-3.2, 2.3, 1.3)),
    ("Through the serving hatch", (-1.85, -0.6, 1.4), (-1.85, 1.3, 1.4)),
    ("Living room to bedroom", (-1.9, -2.4, 1.1), (3.2, -0.9, 1.3)),
    ("Down the hall", (-0.9, 0.92, 1.5), (4.0, 0.92, 1.0)),
    ("Over the dining table, past the lamp", (-4.1, -2.2, 1.15), (-2.0, -3.0, 1.2)),
    ("Kitchen to study", (-3.9, 1.9, 1.3), (0.2, 2.4, 1.4)),
    ("Bedroom to study", (2.2, -1.4, 1.5), (2.0, 2.1, 1.2)),
    ("Low over the rug", (-1.6, -1.0, 0.35), (-1.7, -2.7, 0.35)),
    ("Out of the corner behind the bed", (2.1, -3.0, 1.0), (4.1, -0.6, 1.9)),
    ("Once across", (-3.9, 2.4, 1.2), (3.9, -0.7, 0.7)),
]
_ACROSS = math.pi / 2
_SOFA = 0.3
"""Height of a sofa's middle [m]: its underside is 10 cm above the floor, as on castors, clear of the haze."""
_MOVES = [  # x, y, yaw at both ends
    ("Turn, and through the door into the kitchen", (-2.3, -0.8, 0.0), (-2.95, 1.4, 0.0)),
    ("Out of the kitchen into the hall", (-2.95, 1.4, _ACROSS), (-0.3, 0.95, 0.0)),
    ("From the living room into the hall by the kitchen", (-2.3, -0.8, 0.0), (-0.3, 0.95, 0.0)),
]
_CART = 0.275
"""The same for a cart [m]."""
_DRIVES = [
    ("Along the hall", (-0.8, 0.95, 0.0), (4.0, 0.95, 0.0)),
    ("From the hall into the living room", (1.9, 1.05, math.pi), (-1.8, -0.6, math.pi)),
    ("Around the dining table", (-2.1, -0.6, math.pi), (-1.9, -2.7, 0.0)),
    ("Kitchen to bedroom", (-3.4, 1.2, 0.0), (3.3, -0.8, 0.0)),
    ("Bedroom to the dining table", (3.3, -0.8, math.pi), (-1.9, -2.7, math.pi)),
]
TASKS = (
    *(Task(name, start, goal, robot="quadrotor25") for name, start, goal in _FLIGHTS),
    *(
        Task(name, (*start[:2], height), (*goal[:2], height), start[2], goal[2], robot)
        for robot, height, ways in (("sofa", _SOFA, _MOVES), ("cart", _CART, _DRIVES))
        for name, start, goal in ways
    ),
)
