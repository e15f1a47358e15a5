"""Random ends of flights: at rest anywhere in a place, free on the ground truth and for planners."""

import math

import torch

from nerfnav.errors import InvalidInputError
from nerfnav.experiments.arena import Arena
from nerfnav.field import Unknown, planning_field
from nerfnav.planner import fits
from nerfnav.robots import Quadrotor, RigidState, Robot
from nerfnav.world import Task, contact_check

SPARE = 0.08
"""Room around the body that both ends have on the mesh [m]."""
APART = 0.25
"""Least distance of the ends [share of the box's longest edge]."""
_DRAWS = 5000


def random_task(arena: Arena, seed: int, robot: Robot | None = None) -> Task:
    """A flight of a robot (default: the paper's) between two ends drawn evenly from the box, with any headings.

    Between some of them there may be no way. Raises InvalidInputError where the place has no room for such ends.
    """
    robot = Quadrotor() if robot is None else robot
    generator = torch.Generator().manual_seed(seed)
    apart, body = APART * float(arena.field.box.size.max()), robot.body
    field, touches = planning_field(arena.field, Unknown.OCCUPIED), contact_check(arena.scene, body.grown(SPARE))
    ends: list[tuple[tuple[float, float, float], float]] = []
    for _ in range(_DRAWS):
        drawn = torch.rand(4, generator=generator)
        x, y, z = (arena.field.box.lower + drawn[:3] * arena.field.box.size).tolist()
        point, yaw = (x, y, z), math.tau * (drawn[3].item() - 0.5)
        if ends and math.dist(point, ends[0][0]) < apart:
            continue
        state = RigidState.at_rest(point, yaw)
        if fits(field, body, state) and not touches(state, state):
            ends.append((point, yaw))
        if len(ends) == 2:
            (start, start_yaw), (goal, goal_yaw) = ends
            return Task(f"random {seed}", start, goal, start_yaw, goal_yaw, robot.source)
    raise InvalidInputError(
        f"{arena.scene.name} has no two ends {apart:.2g} m apart with {100 * SPARE:g} cm to spare: fly its tasks"
    )
