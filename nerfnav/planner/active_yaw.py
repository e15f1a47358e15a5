"""Active yaw: choose headings at which the robot's camera sees something, along the path and at the goal.

The share of a picture that shows something is that of visibility.py.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.field import Field
from nerfnav.geometry import FORWARD_MOUNT, Pose, so3
from nerfnav.planner.visibility import VIEW_HEADINGS, VisibilityProfile
from nerfnav.robots import Motion, RigidState, Robot

_PLACES = 10
"""Number of places along the path at which visibility is measured."""
_TURN_COST = 0.1
"""Increase of the mean variance along the path [that of one picture's time] that half a turn at the goal is worth."""
_FINE = 32
"""Least number of headings from which one is chosen for each time step."""
_MOVES = np.arange(-2, 3)
"""Numbers of headings by which a robot may turn in a step."""
_QUICK = 4.0
"""Largest yaw rate along the path [rad/s]."""
_USUAL = 2.5
"""Largest yaw rate of robots without a limit [rad/s]."""
_TURNING = 0.01
"""Cost of a turn by one heading in a step [pictures that show nothing]; four times as much by two."""
_FEWEST = 5
"""Fewest steps of a path on which the yaw may be chosen: the headings of the first two times are given."""
_WORTH = 1.0
"""Fewest pictures that show nothing that must be saved to turn unevenly."""
_ASIDE = 0.1
"""Worth of a picture to the side of the path, or backwards, to a robot that watches [of one along it]."""
Angle = TypeVar("Angle", float, np.ndarray)


@dataclass(frozen=True)
class YawObjective:
    """Objective of active yaw: the visibility of a field from the robot's camera."""

    matter: Field
    """Field that the camera sees."""
    enough: float
    """Share of a picture with edges from which on it is as good as any (see visibility.py)."""
    mount: Pose = FORWARD_MOUNT
    """T_body_camera."""
    may_be: Callable[[RigidState], bool] | None = None
    """Predicate of the states in which the robot fits; None: it fits anywhere."""
    remainder: Float[np.ndarray, " h"] | None = None
    """Share of the variance that a picture from the goal leaves, at headings even from 0 to a whole turn; None: what a
    robot sees while it hovers there does not count."""
    looks_ahead: bool = False
    """True: pictures count by how far they are turned to where the robot moves, as it watches for movers there."""

    def profile_along(self, path: RigidState) -> VisibilityProfile:
        """Measure visibility along a path, even in time, batch shape (n,), with the robot's tilt there."""
        position, up = (_evenly(part, _PLACES) for part in (path.position, path.rotation[..., 2]))
        profile = VisibilityProfile.along(self.matter, position, up, self.enough, self.mount)
        return VisibilityProfile(profile.seen * _ahead(position)) if self.looks_ahead else profile

    def end_cost(self, yaws: Float[np.ndarray, " n"], given: float) -> Float[np.ndarray, " n"]:
        """Return the cost of headings at the goal [rad] [variance that a picture's time adds]: the turn from the
        `given` heading, and the variance that pictures leave there."""
        turn = _TURN_COST * np.abs(wrap_yaw(yaws - given)) / math.pi
        if self.remainder is None:
            return turn
        count = len(self.remainder)
        return turn + np.interp(yaws, math.tau / count * np.arange(count), self.remainder, period=math.tau)

    def fits(self, end: RigidState) -> bool:
        """Return True if the robot may be there."""
        return self.may_be is None or self.may_be(end)


def choose_goal_heading(
    objective: YawObjective, profile: VisibilityProfile, ends: tuple[RigidState, RigidState]
) -> RigidState:
    """Choose the heading at the goal by which a robot knows its place best along the path: it turns evenly as it goes.

    `ends` are start and goal. Between pictures the variance grows by 1, and a picture of which a share shows something
    removes that share of it, all if it is enough: to see nothing for long is worse than to see nothing now and then.
    Half a turn from the given heading is made where the mean, with the variance that is left at the goal, falls by 0.1.
    Only headings at which the robot fits count:
    a corner needs more room than a side. Where none does, the goal stays as it is.
    """
    start, goal = (so3.yaw_of(end.rotation).item() for end in ends)
    share = np.linspace(0, 1, _PLACES)[:, None]
    turns = wrap_yaw(goal - start) + math.tau / VIEW_HEADINGS * np.arange(-VIEW_HEADINGS, VIEW_HEADINGS + 1)
    turns = turns[np.abs(turns) <= math.pi + 1e-6]
    at = start + share * turns
    shown = profile.at(np.broadcast_to(share, at.shape), at)
    cost = _mean_variance(shown) + objective.end_cost(start + turns, goal)
    best_first = np.argsort(cost.round(6), kind="stable")
    for turn in turns[best_first].tolist():
        end = with_heading(ends[1], start + turn)
        if objective.fits(end):
            return end
    return ends[1]


def choose_headings(
    objective: YawObjective,
    profile: VisibilityProfile,
    plan: Motion,
    ends: tuple[RigidState, RigidState, RigidState],
    robot: Robot,
) -> Motion | None:
    """Choose other headings for a motion where these show the robot more than its own do; else return None.

    `ends` are its start, its goal, and the goal with the heading to which it turns: evenly, beside the turns of the
    plan, for where it tilts far it takes less torque to turn about the vertical as well. Of headings that turn by
    4 rad/s at most, or half of what the robot can, those with the fewest pictures that show nothing, by dynamic
    programming (Bellman 1957). The path stays: it is a plan to begin with, whose cost has the turning in it.
    """
    count = len(plan.states.position)
    if count <= max(_FEWEST, robot.minimum_steps):
        return None
    fine = max(_FINE, math.ceil(math.tau * _MOVES[-1] / (limit_yaw_rate(robot, _QUICK) * plan.dt)))
    soon = replace(ends[0], rotation=so3.retract(ends[0].rotation, ends[0].body_rate * plan.dt))
    first, goal, evenly = (so3.yaw_of(end.rotation).item() for end in (soon, *ends[1:]))
    share, grid = np.linspace(0, 1, count)[1:], first + math.tau / fine * np.arange(fine)
    blind = 1 - profile.at(np.repeat(share[:, None], fine, 1), np.repeat(grid[None], count - 1, 0))
    planned = np.unwrap(so3.yaw_of(plan.states.rotation).double().numpy())[1:]
    usual = planned + share * wrap_yaw(evenly - planned[-1])
    at_end = count * objective.end_cost(np.append(grid, evenly), goal)
    least, last = (1 - profile.at(share, usual)).sum() + at_end[-1], at_end[:-1]
    while True:
        moves, cost = _cheapest(blind, last)
        if not least - cost >= _WORTH:
            return None
        end = with_heading(ends[1], grid[sum(moves) % fine])
        if objective.fits(end):
            yaws = _smooth(first + math.tau / fine * np.concatenate([[0, 0], np.cumsum(moves)]))
            waypoints = torch.cat([plan.states.position, torch.from_numpy(yaws)[:, None].to(plan.states.position)], -1)
            free = robot.encode(waypoints, ends[0], end, plan.dt)
            return robot.motion(free, ends[0], end, count - 1, plan.dt)
        last[sum(moves) % fine] = math.inf


def limit_yaw_rate(robot: Robot, wanted: float) -> float:
    """Limit the yaw rate of a robot that turns to see something [rad/s]: to half of what it can."""
    most = robot.most("body rate")
    return min(wanted, _USUAL if most is None else 0.5 * most)


def _cheapest(blind: Float[np.ndarray, "n h"], last: Float[np.ndarray, " h"]) -> tuple[np.ndarray, float]:
    """Find the cheapest turns of each step, in headings from the first one, and their cost; the last step has none."""
    cost = np.full(blind.shape[1], math.inf)
    cost[0] = blind[0, 0]
    came = []
    for row in blind[1:-1]:
        options = np.stack([np.roll(cost, move) + _TURNING * move**2 for move in _MOVES])
        came.append(options.argmin(0))
        cost = options.min(0) + row
    cost = cost + blind[-1]
    heading = int((cost + last).argmin())
    least, moves = float((cost + last)[heading]), []
    for choice in reversed(came):
        moves.append(_MOVES[choice[heading]])
        heading = (heading - moves[-1]) % len(last)
    return np.array([*moves[::-1], 0], dtype=int), least


def _smooth(yaws: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Average each with the one before: rotors do not turn a robot at once."""
    return np.concatenate([yaws[:1], 0.5 * (yaws[1:] + yaws[:-1])])


def _ahead(path: Float[Tensor, "n 3"]) -> Float[np.ndarray, "n h"]:
    """Weigh the headings of a profile from places of a path by how far they are from where it leads: 1 near that, the
    least from a right angle on."""
    moves = np.gradient(path.double().numpy(), axis=0)
    headings = math.tau / VIEW_HEADINGS * np.arange(VIEW_HEADINGS)
    away = np.abs(wrap_yaw(headings - np.arctan2(moves[:, 1:2], moves[:, :1])))
    return np.interp(away, (math.pi / 8, math.pi / 2), (1.0, _ASIDE))


def _evenly(rows: Float[Tensor, "n 3"], count: int) -> Float[Tensor, "k 3"]:
    """Resample rows evenly, linear between."""
    at = np.linspace(0, len(rows) - 1, count)
    return torch.from_numpy(
        np.stack([np.interp(at, np.arange(len(rows)), axis) for axis in rows.double().numpy().T], -1)
    ).to(rows)


def with_heading(state: RigidState, yaw: float) -> RigidState:
    """Turn a state to a heading [rad]."""
    turn = so3.from_yaw(torch.tensor(yaw) - so3.yaw_of(state.rotation)).to(state.rotation)
    return replace(state, rotation=turn @ state.rotation)


def _mean_variance(shown: Float[np.ndarray, "n t"]) -> Float[np.ndarray, " t"]:
    """Average the variance over the pictures of a path, for each of some turns, by the share of each that shows
    something."""
    variance, total = np.zeros(shown.shape[1]), np.zeros(shown.shape[1])
    for share in shown:
        variance = (variance + 1) * (1 - share)
        total += variance
    return total / len(shown)


def wrap_yaw(angle: Angle) -> Angle:
    """Wrap an angle [rad] to half a turn on either side."""
    return (angle + math.pi) % math.tau - math.pi
