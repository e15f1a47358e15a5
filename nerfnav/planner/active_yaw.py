"""Active yaw: choose headings that show the robot's camera something, on the way and at the goal (see
visibility.py)."""

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
"""From how many places on its way a robot looks around that looks for headings."""
_DEAR = 0.1
"""How much more variance on the way [that of one picture's time] half a turn at the goal is worth."""
_FINE = 32
"""Headings of which one is chosen for each time step, at least."""
_MOVES = np.arange(-2, 3)
"""By how many of them a robot turns in a step."""
_QUICK = 4.0
"""With which it turns at most on its way [rad/s]."""
_USUAL = 2.5
"""The same for robots of which nobody has said how fast they turn [rad/s]."""
_TURNING = 0.01
"""What it costs to turn by one of them in a step [pictures that show nothing]; by two, four times as much."""
_FEWEST = 5
"""Steps of a way on which it may turn unevenly: the headings of the first two times are given."""
_WORTH = 1.0
"""How many pictures fewer that show nothing are worth to turn unevenly."""
Angle = TypeVar("Angle", float, np.ndarray)


@dataclass(frozen=True)
class YawObjective:
    """How a robot looks at what is on its way."""

    matter: Field
    """What its camera sees."""
    enough: float
    """Share of a picture that has edges from which on it is as good as any (see visibility.py)."""
    mount: Pose = FORWARD_MOUNT
    """T_body_camera."""
    may_be: Callable[[RigidState], bool] | None = None
    """Whether it fits somewhere; None: anywhere."""

    def sights(self, way: RigidState) -> VisibilityProfile:
        """From places of a way, even in time, batch shape (n,), as a robot is tilted there that goes it."""
        position, up = (_evenly(part, _PLACES) for part in (way.position, way.rotation[..., 2]))
        return VisibilityProfile.along(self.matter, (position, up), self.enough, self.mount)

    def fits(self, end: RigidState) -> bool:
        """Whether the robot may be there."""
        return self.may_be is None or self.may_be(end)


def choose_goal_heading(
    watch: YawObjective, sights: VisibilityProfile, ends: tuple[RigidState, RigidState]
) -> RigidState:
    """The goal with the heading by which a robot knows best where it is on the way to it: it turns evenly as it goes.

    `ends` are start and goal. Between pictures the variance grows by 1, and a picture of which a share shows
    something takes that share of it away, all where it is enough: to see nothing for long is worse than to see
    nothing now and then. Half a turn from the heading that was asked for is made where the mean falls by 0.1. Of the
    headings with which the robot may be there: a corner needs more room than a side. Where it may with none, the goal
    stays as it is.
    """
    start, goal = (so3.yaw_of(end.rotation).item() for end in ends)
    share = np.linspace(0, 1, _PLACES)[:, None]
    turns = wrapped(goal - start) + math.tau / VIEW_HEADINGS * np.arange(-VIEW_HEADINGS, VIEW_HEADINGS + 1)
    turns = turns[np.abs(turns) <= math.pi + 1e-6]
    at = start + share * turns
    shown = sights.at(np.broadcast_to(share, at.shape), at)
    off = np.abs(wrapped(start + turns - goal))
    best_first = np.argsort((_mean_variance(shown) + _DEAR * off / math.pi).round(6), kind="stable")
    for turn in turns[best_first].tolist():
        end = with_heading(ends[1], start + turn)
        if watch.fits(end):
            return end
    return ends[1]


def choose_headings(
    watch: YawObjective,
    sights: VisibilityProfile,
    way: Motion,
    ends: tuple[RigidState, RigidState, RigidState],
    robot: Robot,
) -> Motion | None:
    """A motion with other headings, where these show the robot more than its own do; else None.

    `ends` are where it starts, its goal, and that with the heading to which it turns: evenly, beside what the plan
    turns anyway, for where it tilts far it takes less torque to turn about the vertical as well. Of headings that turn
    by 4 rad/s at most, or half of what the robot can, those with the fewest pictures that show nothing, by dynamic
    programming (Bellman 1957). The way stays: it is a plan to begin with, whose cost has the turning in it.
    """
    count = len(way.states.position)
    if count <= max(_FEWEST, robot.minimum_steps):
        return None
    fine = max(_FINE, math.ceil(math.tau * _MOVES[-1] / (turning_rate(robot, _QUICK) * way.dt)))
    soon = replace(ends[0], rotation=so3.retract(ends[0].rotation, ends[0].body_rate * way.dt))
    first, goal, evenly = (so3.yaw_of(end.rotation).item() for end in (soon, *ends[1:]))
    share, grid = np.linspace(0, 1, count)[1:], first + math.tau / fine * np.arange(fine)
    blind = 1 - sights.at(np.repeat(share[:, None], fine, 1), np.repeat(grid[None], count - 1, 0))
    dear = _DEAR * count / math.pi
    planned = np.unwrap(so3.yaw_of(way.states.rotation).double().numpy())[1:]
    usual = planned + share * wrapped(evenly - planned[-1])
    least = (1 - sights.at(share, usual)).sum() + dear * abs(wrapped(evenly - goal))
    last = dear * np.abs(wrapped(grid - goal))
    while True:
        moves, cost = _cheapest(blind, last)
        if not least - cost >= _WORTH:
            return None
        end = with_heading(ends[1], grid[sum(moves) % fine])
        if watch.fits(end):
            yaws = _smooth(first + math.tau / fine * np.concatenate([[0, 0], np.cumsum(moves)]))
            waypoints = torch.cat([way.states.position, torch.from_numpy(yaws)[:, None].to(way.states.position)], -1)
            free = robot.encode(waypoints, ends[0], end, way.dt)
            return robot.motion(free, ends[0], end, count - 1, way.dt)
        last[sum(moves) % fine] = math.inf


def turning_rate(robot: Robot, wanted: float) -> float:
    """With which a robot turns to see something [rad/s]: as wanted, or half of what it can, where that is less."""
    most = robot.most("body rate")
    return min(wanted, _USUAL if most is None else 0.5 * most)


def _cheapest(blind: Float[np.ndarray, "n h"], last: Float[np.ndarray, " h"]) -> tuple[np.ndarray, float]:
    """By how many headings to turn in each step, from the first of them, and what that costs; it arrives unturned."""
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
    """Each the mean of it and the one before: rotors do not turn a robot at once."""
    return np.concatenate([yaws[:1], 0.5 * (yaws[1:] + yaws[:-1])])


def _evenly(way: Float[Tensor, "n 3"], count: int) -> Float[Tensor, "k 3"]:
    """So many of what lies along a way, linear between."""
    at = np.linspace(0, len(way) - 1, count)
    return torch.from_numpy(
        np.stack([np.interp(at, np.arange(len(way)), axis) for axis in way.double().numpy().T], -1)
    ).to(way)


def with_heading(state: RigidState, yaw: float) -> RigidState:
    """The same, turned."""
    turn = so3.from_yaw(torch.tensor(yaw) - so3.yaw_of(state.rotation)).to(state.rotation)
    return replace(state, rotation=turn @ state.rotation)


def _mean_variance(shown: Float[np.ndarray, "n t"]) -> Float[np.ndarray, " t"]:
    """Over the pictures of a way, for each of some turns, from how much of each shows something, 0 to 1."""
    variance, total = np.zeros(shown.shape[1]), np.zeros(shown.shape[1])
    for share in shown:
        variance = (variance + 1) * (1 - share)
        total += variance
    return total / len(shown)


def wrapped(angle: Angle) -> Angle:
    """The same angle [rad], within half a turn."""
    return (angle + math.pi) % math.tau - math.pi
