"""Worlds of moving boxes: the corridors of SANDO's benchmark `dynamic`, from their seeds.

Draws come from Python's Mersenne Twister, obstacle by obstacle: x, y and z of the centre, and for movers, which come
first, three scales, the phase and the slowness of a trefoil. Pillars stand on the floor, bars lie along y.

Kondo, Tordesillas, How, "Safe autonomous trajectory planning for dynamic unknown environments", 2604.07599, 2026; the
numbers are those of its launch file.
"""

import random
from dataclasses import dataclass

from nerfnav.core.errors import UnknownNameError
from nerfnav.obstacles import BoxShape, Obstacle, ObstacleSet, Trefoil
from nerfnav.planner.moving.problem import MotionLimits, MovingProblem

LEVELS = {"easy": 50, "medium": 100, "hard": 200}
"""Level to its number of obstacles."""
START, GOAL = (0.0, 0.0, 2.0), (105.0, 0.0, 2.0)
"""Ends of the flight [m]."""
HALF_M = 0.1
"""Half of the robot's edges [m]."""
LIMITS = MotionLimits(speed=5.0, acceleration=20.0, jerk=100.0)
"""Limits of the robot, each axis on its own."""
HEIGHTS, ASIDE_M = (0.5, 6.0), 6.0
"""Lowest and highest z of the robot's centre, and the largest |y| [m]: round the outside nothing is ever met."""
CUBE_M = 0.8
"""Edge of the cube that SANDO's judge takes every obstacle for, with the robot a point [m]."""
_SPANS = ((5.0, 100.0), (-6.0, 6.0), (0.5, 4.5))
_MOVING, _PILLARS = 0.65, 0.35
_MOVER, _PILLAR, _BAR = (0.8, 0.8, 0.8), (0.4, 0.4, 4.0), (0.4, 4.0, 0.4)
_INSIDE_M = 0.02
"""Distance from the borders of the region that plans keep [m]."""


@dataclass(frozen=True)
class World:
    """World of one seed."""

    level: str
    """One of LEVELS."""
    seed: int
    """Of its draws."""
    obstacles: ObstacleSet
    """Movers, then pillars, then bars: their true boxes."""

    @property
    def cubes(self) -> ObstacleSet:
        """Cubes of SANDO's judge, in place of the true boxes."""
        return ObstacleSet(tuple(_resized(obstacle, CUBE_M) for obstacle in self.obstacles.obstacles))

    def problem(self) -> MovingProblem:
        """Plan through this world so that neither rule of collision is broken: the robot's box among the true boxes,
        and a point among the cubes."""
        extra = tuple(
            _resized(obstacle, CUBE_M - 2 * HALF_M) for obstacle in self.obstacles.obstacles if not obstacle.moves
        )
        lower = (START[0], -ASIDE_M + _INSIDE_M, HEIGHTS[0] + _INSIDE_M)
        upper = (GOAL[0], ASIDE_M - _INSIDE_M, HEIGHTS[1] - _INSIDE_M)
        both = ObstacleSet((*self.obstacles.obstacles, *extra))
        return MovingProblem(both, START, GOAL, (HALF_M, HALF_M, HALF_M), lower, upper, LIMITS)


def make_world(level: str, seed: int) -> World:
    """Draw the world of a level and a seed. Raises UnknownNameError for another level."""
    if level not in LEVELS:
        raise UnknownNameError("level", level, LEVELS)
    uniform, count = random.Random(seed).uniform, LEVELS[level]
    movers = int(_MOVING * count)
    found: list[Obstacle] = []
    for index in range(count):
        x, y, z = (uniform(*span) for span in _SPANS)
        if index < movers:
            scale = (uniform(2.0, 4.0), uniform(2.0, 4.0), uniform(2.0, 4.0))
            motion = Trefoil(scale, uniform(0.0, 3.0), uniform(4.0, 6.0))
            found.append(Obstacle(f"mover {index}", BoxShape(_MOVER), (x, y, z), motion=motion))
        elif index - movers < _PILLARS * (count - movers):
            found.append(Obstacle(f"pillar {index}", BoxShape(_PILLAR), (x, y, 0.5 * _PILLAR[2])))
        else:
            found.append(Obstacle(f"bar {index}", BoxShape(_BAR), (x, y, z)))
    return World(level, seed, ObstacleSet(tuple(found)))


def _resized(obstacle: Obstacle, edge: float) -> Obstacle:
    name = f"cube at {obstacle.name}"
    return Obstacle(name, BoxShape((edge, edge, edge)), obstacle.position, motion=obstacle.motion)
