"""Reducer of obstacles: choose, change, copy, separate and delete them."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.obstacles import MOST
from nerfnav_app.places.place import Place
from nerfnav_app.reducers.common import add_notice
from nerfnav_app.state import obstacles as o
from nerfnav_app.state.alignment import Vector
from nerfnav_app.state.session import Session
from nerfnav_app.text import sentence

_NAME = 100
"""Longest name of an obstacle."""


def command_obstacles(session: Session, command: o.ObstacleAction) -> Session:
    """Reduce a command on obstacles; one that is not there any more is left alone."""
    match command:
        case o.ChooseObstacle(name):
            ended = session if name == session.chosen else end_path(session)
            return replace(ended, chosen=name)
        case o.ChooseMode(mode):
            return replace(session, gizmo_mode=mode)
        case o.PlayMotions(on):
            return replace(session, motion_time=0.0 if on and session.movers and not session.in_flight else None)
        case o.DeleteObstacle(name):
            return replace(session, obstacles=tuple(each for each in session.obstacles if each.name != name))
    placed = session.obstacle_named(command.name)
    if placed is None:
        return replace(session, held=False)
    if isinstance(command, o.ChangeObstacle):
        return _change(session, placed, command)
    if isinstance(command, o.ChangePace):
        return _set(session, placed, lambda: placed.with_pace(command.speed, command.closed))
    if isinstance(command, o.RemoveMotion):
        return _set(session, placed, lambda: placed.changed(motion=None))
    if isinstance(command, o.SeparateObstacle):
        part = placed.separated(o.free_name(session.obstacles, "part"))
        known = tuple(part if each is placed else each for each in session.obstacles)
        return replace(session, obstacles=known, chosen=part.name) if placed.selects else session
    x, y, z = placed.entry.position
    low, high = placed.obstacle.span(np.eye(3))
    name = o.free_name(session.obstacles, placed.name.rstrip("0123456789 ") or placed.name)
    return add_obstacle(session, placed.changed(name=name, position=(x + 1.2 * float(high[0] - low[0]), y, z)))


def add_obstacle(session: Session, placed: o.PlacedObstacle) -> Session:
    """Add an obstacle, and choose it; add a notice where there are too many."""
    if len(session.obstacles) >= MOST:
        return add_notice(session, "Not placed", f"There are {MOST} obstacles already: delete some first.", bad=True)
    return replace(end_path(session), obstacles=(*session.obstacles, placed), chosen=placed.name)


def add_way_point(session: Session, place: Place, placed: o.PlacedObstacle, point: Vector) -> Session:
    """Add a way point [m] to the path of an obstacle; add a notice where it lies outside the place, or is
    where the obstacle stands."""
    if not place.field.box.contains(torch.tensor(point)):
        at = ", ".join(f"{axis} {value:.2f}" for axis, value in zip("xyz", point, strict=True))
        text = f"The way point at {at} m lies outside the place: click inside it."
        return add_notice(session, "No way point", text, bad=True)
    return _set(session, placed, lambda: placed.with_way_point(point))


def end_path(session: Session) -> Session:
    """Let clicks draw no further way points; add a notice where there are none yet."""
    placed = session.drawing
    if session.aiming is not o.PathPoint.NEXT:
        return session
    session = replace(session, aiming=None)
    if placed is None or placed.path is not None:
        return session
    return add_notice(session, "No path", "A path has at least one way point: click where the obstacle goes.")


def play_motions(session: Session, seconds: float) -> Session:
    """Move obstacles on by some time [s] while their motions are played."""
    time = session.motion_time
    return session if time is None else replace(session, motion_time=time + seconds)


def _set(session: Session, placed: o.PlacedObstacle, make: Callable[[], o.PlacedObstacle]) -> Session:
    """Replace an obstacle by the one that `make` returns; add a notice where that is impossible."""
    try:
        changed = make()
        assert changed.obstacle
    except InvalidInputError as error:
        return add_notice(session, "Not changed", sentence(str(error)), bad=True)
    return replace(session, obstacles=tuple(changed if each is placed else each for each in session.obstacles))


def _change(session: Session, placed: o.PlacedObstacle, command: o.ChangeObstacle) -> Session:
    name, changed = command.changed.name.strip()[:_NAME], command.changed
    taken = name != placed.name and session.obstacle_named(name) is not None
    if taken or not name:
        wrong = f"another obstacle is named {name!r}: give each a name of its own" if taken else "a name has letters"
        return add_notice(session, "Not renamed", sentence(wrong), bad=True)
    done = _set(
        replace(session, held=False), placed, lambda: changed if name == changed.name else changed.changed(name=name)
    )
    if done.obstacles is session.obstacles:  # it was refused
        return done
    chosen = name if session.chosen == placed.name else session.chosen
    return replace(done, chosen=chosen, held=command.held, in_hand=name)
