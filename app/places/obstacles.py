"""Obstacles in a place: placed in its field and its ground truth, and checked against the ends of a route."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np

from nerfnav.core.errors import InvalidInputError
from nerfnav.obstacles import Obstacle, ObstacleSet, place_in_field, place_in_scene, read_obstacles
from nerfnav.robots import Robot
from nerfnav.world import Scene
from nerfnav_app.places.ends import Ends, Point
from nerfnav_app.places.place import Place, Truth


def open_with_obstacles(place: Place, path: Path) -> Place:
    """The place with the obstacles of a file in it: those that stand in the map, in the ground truth, and so in the
    camera; those that move beside them.

    Raises InvalidInputError for a file that cannot be read, and for obstacles that stand outside the place.
    """
    obstacles = read_obstacles(path)
    standing = ObstacleSet(_standing(obstacles))
    if not standing.obstacles:
        return replace(place, obstacles=obstacles)
    try:
        field, truth = place_in_field(place.field, standing), place.truth
    except InvalidInputError as error:
        raise InvalidInputError(f"{path}: {error}") from error
    if truth is not None:
        before = truth.load

        @cache
        def load() -> Scene:
            return place_in_scene(before(), standing)

        truth = Truth(truth.tasks, load)
    return replace(place, field=field, truth=truth, obstacles=obstacles)


def require_still(place: Place, path: Path) -> Place:
    """The place, whose obstacles stand. Raises InvalidInputError, which names the file, for one that moves."""
    if place.obstacles is not None and place.obstacles.moving:
        raise InvalidInputError(
            f"{path}: the obstacle {place.obstacles.moving[0].name!r} moves, and here obstacles stand: leave its "
            "motion out"
        )
    return place


def require_clear_ends(obstacles: ObstacleSet, robot: Robot, ends: Ends) -> None:
    """Raise InvalidInputError, which names it, for an obstacle that a robot touches at an end of its route.

    One that moves counts at the start, where it is at take-off.
    """
    for name, end in (("start", ends.start), ("goal", ends.goal)):
        points = robot.body.points_at(end.state()).double().numpy()
        for obstacle in obstacles.obstacles if end is ends.start else _standing(obstacles):
            touched = bool((obstacle.signed_distance(points) <= 0).any())
            if touched or _fits_inside(obstacle, robot.body.radius, end.position):
                raise InvalidInputError(f"the obstacle {obstacle.name!r} stands on the {name}: move one of them")


def _standing(obstacles: ObstacleSet) -> tuple[Obstacle, ...]:
    return tuple(obstacle for obstacle in obstacles.obstacles if not obstacle.moves)


def _fits_inside(obstacle: Obstacle, radius: float, middle: Point) -> bool:
    """Check for an obstacle that may be between the points of a body."""
    boxes = ObstacleSet((obstacle,)).boxes([0.0])
    farthest = np.abs(boxes.centers[0, 0] - np.array(middle)) + boxes.halves[0]
    return bool(np.linalg.norm(farthest) <= radius)
