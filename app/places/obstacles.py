"""Obstacles in a place: placed in its field and its ground truth, and checked against the ends of a route."""

from collections.abc import Iterable
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Float

from nerfnav.core.errors import InvalidInputError
from nerfnav.field import VoxelField
from nerfnav.obstacles import (
    STILL,
    CutOut,
    Held,
    Obstacle,
    ObstacleSet,
    place_in_field,
    place_in_scene,
    read_obstacles,
    replace_in_field,
    require_placeable,
)
from nerfnav.robots import RigidState, Robot
from nerfnav_app.places.ends import EndRole, Ends
from nerfnav_app.places.place import Place, Truth

if TYPE_CHECKING:
    from nerfnav.world import Scene  # slow to import


def open_with_obstacles(place: Place, path: Path) -> Place:
    """The place with the obstacles of a file in it: those that stand in the map, in the ground truth, and so in the
    camera; those that move beside them.

    Raises InvalidInputError for a file that cannot be read, for obstacles that stand outside the place, and for a
    cut-out of nothing.
    """
    obstacles = read_obstacles(path)
    try:
        for obstacle in _standing(obstacles).obstacles:
            require_placeable(place.field, obstacle)
        return place_obstacles(place, obstacles)
    except InvalidInputError as error:
        raise InvalidInputError(f"{path}: {error}") from error


def require_standing(path: Path) -> None:
    """Raise InvalidInputError for a file that cannot be read, or in which an obstacle moves or is not announced."""
    for obstacle in read_obstacles(path).moving:
        does, what = ("moves", "its motion") if obstacle.moves else ("is not announced", "its `seen`")
        raise InvalidInputError(
            f"{path}: the obstacle {obstacle.name!r} {does}, and here obstacles stand: leave {what} out"
        )


def take_up(obstacle: Obstacle) -> Obstacle:
    """An obstacle in a hand; one that is beside the field, and a part of it, stay what they are."""
    stays = obstacle.moves or obstacle.seen or isinstance(obstacle.shape, CutOut)
    return obstacle if stays else replace(obstacle, motion=Held())


def put_down(place: Place) -> Place:
    """A place with the obstacle in it that a hand holds, where it is."""
    if place.obstacles is None or place.bare is None:
        return place
    placed = [
        replace(each, motion=STILL) if isinstance(each.motion, Held) else each for each in place.obstacles.obstacles
    ]
    return place_obstacles(place.without_obstacles(), ObstacleSet(tuple(placed)), place)


def place_obstacles(place: Place, obstacles: ObstacleSet, last: Place | None = None) -> Place:
    """A place without obstacles with some in it: those that stand in the map, in the ground truth, and so in the
    camera; those that move beside them.

    Where `last` is the same place with others, only what differs is computed. Raises InvalidInputError for obstacles
    that stand outside the place.
    """
    truth, standing = place.truth, _standing(obstacles)
    before = None if last is None or last.obstacles is None else _standing(last.obstacles)
    if last is not None and standing == before:
        return replace(last, obstacles=obstacles)
    if not standing.obstacles:
        return replace(place, obstacles=obstacles, bare=place)
    if last is not None and before is not None and isinstance(place.field, VoxelField):
        assert isinstance(last.field, VoxelField), "obstacles leave the kind of a field as it is"
        field = replace_in_field(place.field, standing, last.field, before)
    else:
        field = place_in_field(place.field, standing)
    if truth is not None:
        load_bare = truth.load

        @cache
        def load() -> "Scene":
            return place_in_scene(load_bare(), standing)

        truth = Truth(truth.tasks, load)
    return replace(place, field=field, truth=truth, obstacles=obstacles, bare=place)


def require_clear_ends(obstacles: ObstacleSet, robot: Robot, ends: Ends) -> None:
    """Raise InvalidInputError, which names it, for an obstacle that a robot touches at an end of its route.

    One that moves counts at the start, where it is at take-off.
    """
    for which in EndRole:
        counted = obstacles.obstacles if which is EndRole.START else _standing(obstacles).obstacles
        touched = find_touched(counted, robot, ends.of(which).state())
        if touched is not None:
            raise InvalidInputError(f"the obstacle {touched.name!r} stands on the {which.value}: move one of them")


def _standing(obstacles: ObstacleSet) -> ObstacleSet:
    return ObstacleSet(obstacles.standing)


def find_touched(obstacles: Iterable[Obstacle], robot: Robot, state: RigidState, time: float = 0.0) -> Obstacle | None:
    """Find an obstacle that a robot in a state touches at a time of the flight [s]; None where it touches none."""
    points, middle = robot.body.points_at(state).double().numpy(), state.position.double().numpy()
    for obstacle in obstacles:
        touched = bool((obstacle.signed_distance(points, time) <= 0).any())
        if touched or _fits_inside(obstacle, robot.body.radius, middle, time):
            return obstacle
    return None


def _fits_inside(obstacle: Obstacle, radius: float, middle: Float[np.ndarray, "3"], time: float) -> bool:
    """Check for an obstacle that may be between the points of a body."""
    boxes = ObstacleSet((obstacle,)).boxes([time])
    farthest = np.abs(boxes.centers[0, 0] - middle) + boxes.halves[0]
    return bool(np.linalg.norm(farthest) <= radius)
