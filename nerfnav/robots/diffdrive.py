"""The differential drive: two wheels that roll and never slide; it heads where it drives, or against it.

Notation: psi heading, e(psi) its unit vector, s signed forward speed, w yaw rate, a and alpha their changes. A step of
dt is driven along an arc with the speeds that the robot has at its start; the wheels change speed at its end:

    psi_{t+1} = psi_t + w_t dt                      w_{t+1} = w_t + alpha_t dt
    p_{t+1} = p_t + s_t dt S(w_t dt) e((psi_t + psi_{t+1}) / 2)      s_{t+1} = s_t + a_t dt,   v_t = s_t e(psi_t)

with S(x) = sin(x/2) / (x/2), so the motion between the times is exact and nothing slides. Positions alone would be a
flat output, but a singular one: at standstill a velocity has no direction. Speeds and headings have no such place, so
they are what is free,

    free = (s_1 .. s_{N-1}, psi_2 .. psi_{N-1}),  2 N - 3 numbers,

and the two equations that are left, p_N = goal, are met by moving the free numbers to the nearest ones that lead
there: Gauss and Newton's method in the metric of `free_scales`, z <- z - J' (J J')^-1 (p_N(z) - goal), a smooth map
wherever the robot moves at all. Forward and reverse are signs of s.
"""

import math
from dataclasses import dataclass
from typing import final

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.errors import InvalidInputError
from nerfnav.geometry import so3
from nerfnav.robots.body import Body
from nerfnav.robots.ground import about_z, check_ground_ends, heading, row, spatial, wrapped
from nerfnav.robots.limits import penalty
from nerfnav.robots.robot import Limit, Robot
from nerfnav.robots.state import Motion, RigidState

_ROUNDS = 6
"""Steps of Gauss and Newton to the goal: each squares what is missing."""
_DAMPING = 1e-12
"""Keeps J J' invertible [m^2] where a robot at standstill cannot reach sideways."""
_TYPICAL_SPEED, _TYPICAL_TURN = 0.5, 0.5
"""How much a speed [m/s] and a heading [rad] may change before the motion is quite another one."""
_ALONG = 0.8
"""Share of a path along its waypoints' headings from which on these are taken as they are."""


@dataclass(frozen=True)
class DiffDriveConfig:
    """A small robot on two wheels."""

    extents: tuple[float, float, float] = (0.14, 0.12, 0.08)
    """Edge lengths of the body [m]."""
    point_counts: tuple[int, int, int] = (7, 6, 4)
    """Body points along each edge at which density is asked for: 2.5 cm apart."""
    max_speed: float = 2.0
    """Forward or reverse [m/s]."""
    max_yaw_rate: float = 6.0
    """[rad/s]"""
    max_acceleration: float = 8.0
    """[m/s^2]"""
    max_yaw_acceleration: float = 40.0
    """[rad/s^2]"""


@final
class DiffDrive(Robot):
    """A ground robot with two numbers to choose: forward and yaw acceleration."""

    name = "diffdrive"
    action_names = ("acceleration_mps2", "yaw_acceleration_radps2")
    minimum_steps = 4
    planar = True

    def __init__(self, config: DiffDriveConfig | None = None) -> None:
        """A differential drive with the given constants (default: those of DiffDriveConfig)."""
        self.config = config = DiffDriveConfig() if config is None else config
        self.body = Body.box(config.extents, config.point_counts)
        self.action_weights = (config.max_acceleration**-2, config.max_yaw_acceleration**-2)
        bounds = {
            ("speed", "m/s"): config.max_speed,
            ("yaw rate", "rad/s"): config.max_yaw_rate,
            ("acceleration", "m/s^2"): config.max_acceleration,
            ("yaw acceleration", "rad/s^2"): config.max_yaw_acceleration,
        }
        self.bounds = tuple(Limit(*named, -most, most) for named, most in bounds.items())

    def step(self, state: RigidState, action: Float[Tensor, "*batch 2"], dt: float) -> RigidState:
        """The state after `dt` [s]; a velocity across the heading, which wheels do not have, is lost."""
        speed = (state.rotation[..., 0] * state.velocity).sum(-1)
        rate = state.body_rate[..., 2]
        turn = rate * dt
        along = spatial(_unit(0.5 * turn) * (speed * dt * _chord(turn))[..., None], 0.0)
        rotation = state.rotation @ so3.from_yaw(turn)
        faster = speed + action[..., 0] * dt
        return RigidState(
            state.position + (state.rotation @ along[..., None])[..., 0],
            rotation[..., 0] * faster[..., None],
            rotation,
            about_z(rate + action[..., 1] * dt),
        )

    def free_numbers(self, steps: int) -> int:
        """How many numbers are free over `steps` steps."""
        if steps < self.minimum_steps:
            raise InvalidInputError(f"a differential drive needs at least {self.minimum_steps} steps, not {steps}")
        return 2 * steps - 3

    def motion(
        self, free: Float[Tensor, "*batch k"], start: RigidState, goal: RigidState, steps: int, dt: float
    ) -> Motion:
        """The motion through the nearest free numbers that lead to the goal.

        Only a robot that rests all the time has none near that would move it sideways: it then ends beside the goal.
        """
        expected = self.free_numbers(steps)
        if free.shape[-1] != expected:
            raise InvalidInputError(f"{steps} steps have {expected} free numbers, not {free.shape[-1]}")
        batch = free.shape[:-1]
        first_speed = row((start.rotation[..., 0] * start.velocity).sum(-1), batch)
        last_speed = row((goal.rotation[..., 0] * goal.velocity).sum(-1), batch)
        rate = start.body_rate[..., 2]
        held = torch.cat([row(heading(start), batch), row(heading(start) + rate * dt, batch)], -1)
        last = free[..., -1:] + wrapped(row(heading(goal), batch) - free[..., -1:])

        def path(numbers: Tensor) -> tuple[Tensor, Tensor]:
            """Speeds s_0 .. s_{N-1} and headings psi_0 .. psi_N."""
            speeds, turns = numbers[..., : steps - 1], numbers[..., steps - 1 :]
            return torch.cat([first_speed, speeds], -1), torch.cat([held, turns, last], -1)

        away = goal.position[..., :2] - start.position[..., :2]
        numbers = free
        for _ in range(_ROUNDS):
            numbers = numbers - _correction(*path(numbers), away, dt)
        speeds, yaw = path(numbers)
        way = _displacements(speeds, yaw, dt).cumsum(-2)
        begin = row(start.position[..., :2], batch)
        position = spatial(torch.cat([begin, begin + way], -2), start.position[..., 2])
        speeds = torch.cat([speeds, last_speed], -1)
        rates = torch.cat([yaw.diff(dim=-1) / dt, row(goal.body_rate[..., 2], batch)], -1)
        velocity = spatial(speeds[..., None] * _unit(yaw), 0.0)
        velocity = torch.cat([row(start.velocity, batch), velocity[..., 1:, :]], -2)
        actions = torch.stack([speeds.diff(dim=-1), rates.diff(dim=-1)], -1) / dt
        reached = (way[..., -1:, :] - away).square().sum(-1, keepdim=True) < _EXACT**2
        end = torch.where(reached, row(goal.position, batch), position[..., -1:, :])
        position = torch.cat([position[..., :-1, :], end], -2)
        return Motion(RigidState(position, velocity, so3.from_yaw(yaw), about_z(rates)), actions, dt)

    def encode(
        self, waypoints: Float[Tensor, "times 4"], start: RigidState, goal: RigidState, dt: float
    ) -> Float[Tensor, " k"]:
        """Speeds and headings along waypoints: their headings where these point along the way, else the way's own."""
        steps = waypoints.shape[0] - 1
        self.free_numbers(steps)
        moved = waypoints[1:, :2] - waypoints[:-1, :2]
        given = (moved * _unit(waypoints[:-1, 3])).sum(-1)
        if given.abs().sum() >= _ALONG * moved.norm(dim=-1).sum():
            yaw = _unwrapped(torch.cat([heading(start)[None], waypoints[1:, 3]]))
            return torch.cat([given[1:] / dt, yaw[2:-1]])
        yaw, gear = _headings_along(moved, heading(start), heading(goal))
        return torch.cat([gear * moved[1:].norm(dim=-1) / dt, yaw[2:-1]])

    def free_scales(self, free: Float[Tensor, " k"]) -> Float[Tensor, " k"]:
        """Half a metre per second, half a radian."""
        scales = torch.full_like(free, _TYPICAL_SPEED)
        scales[(free.shape[-1] + 1) // 2 :] = _TYPICAL_TURN
        return scales

    def demands(self, motion: Motion) -> dict[str, Float[Tensor, "*batch times"]]:
        """Forward speed [m/s], yaw rate [rad/s], and how fast both change."""
        states = motion.states
        return {
            "speed": (states.rotation[..., 0] * states.velocity).sum(-1),
            "yaw rate": states.body_rate[..., 2],
            "acceleration": motion.actions[..., 0],
            "yaw acceleration": motion.actions[..., 1],
        }

    def limits(self, motion: Motion) -> Float[Tensor, "*batch"]:
        """Squared excess over the bounds."""
        return penalty(self, motion)

    def check_ends(self, start: RigidState, goal: RigidState) -> None:
        """Both ends must be level, at one height, and move along their headings."""
        check_ground_ends(self.name, start, goal)
        for which, state in (("start", start), ("goal", goal)):
            if bool((state.rotation[..., 1] * state.velocity).sum(-1).abs().max() > _SLIDING):
                raise InvalidInputError(f"a differential drive cannot slide: its {which} moves across its heading")


_EXACT = 1e-4
"""Distance to the goal [m] that is rounding."""
_SLIDING = 1e-3
"""Speed across the heading [m/s] that counts as none."""
_TURNING_SHARE = 0.25
"""Share of the way over which headings turn from the start's to the way's, and at the end to the goal's."""


def _unit(angle: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch 2"]:
    """e(angle)."""
    return torch.stack([torch.cos(angle), torch.sin(angle)], -1)


def _chord(turn: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
    """S: the chord of an arc of unit length that turns by `turn` [rad]."""
    return torch.sinc(turn / (2 * math.pi))


def _displacements(
    speeds: Float[Tensor, "*batch n"], yaw: Float[Tensor, "*batch times"], dt: float
) -> Float[Tensor, "*batch n 2"]:
    """What each step moves the robot by [m]."""
    turn, middle = yaw.diff(dim=-1), 0.5 * (yaw[..., :-1] + yaw[..., 1:])
    return (speeds * dt * _chord(turn))[..., None] * _unit(middle)


def _correction(
    speeds: Float[Tensor, "*batch n"], yaw: Float[Tensor, "*batch times"], away: Float[Tensor, "*batch 2"], dt: float
) -> Float[Tensor, "*batch k"]:
    """J' (J J')^-1 (p_N - goal) in the metric of the typical changes, for speeds 1 .. N-1 and headings 2 .. N-1."""
    turn, middle = yaw.diff(dim=-1), 0.5 * (yaw[..., :-1] + yaw[..., 1:])
    along, chord = _unit(middle), _chord(turn)
    across = torch.stack([-along[..., 1], along[..., 0]], -1)
    missed = (speeds * dt * chord)[..., None].mul(along).sum(-2) - away
    by_speed = (dt * chord)[..., None] * along
    # d/dpsi of the arc that begins and of the one that ends at a heading
    bent = (speeds * dt * _chord_slope(turn, chord))[..., None] * along
    swung = (0.5 * speeds * dt * chord)[..., None] * across
    by_yaw = (swung - bent)[..., 2:, :] + (swung + bent)[..., 1:-1, :]
    jacobian = torch.cat([_TYPICAL_SPEED * by_speed[..., 1:, :], _TYPICAL_TURN * by_yaw], -2)
    square = jacobian.transpose(-1, -2) @ jacobian + _DAMPING * torch.eye(2).to(jacobian)
    change = (jacobian @ torch.linalg.solve(square, missed[..., None]))[..., 0]
    count = speeds.shape[-1] - 1
    return torch.cat([_TYPICAL_SPEED * change[..., :count], _TYPICAL_TURN * change[..., count:]], -1)


def _chord_slope(turn: Tensor, chord: Tensor) -> Tensor:
    """dS / dx = (cos(x/2) - S) / x."""
    small = turn.abs() < _SMALL
    safe = torch.where(small, torch.ones_like(turn), turn)
    return torch.where(small, -turn / 12, (torch.cos(0.5 * safe) - chord) / safe)


_SMALL = 1e-3
"""Turn [rad] below which the slope of S is taken from its series."""


def _headings_along(
    moved: Float[Tensor, "n 2"], first: Float[Tensor, ""], last: Float[Tensor, ""]
) -> tuple[Float[Tensor, " times"], float]:
    """Headings at each time for a robot that drives along a path, and 1 for forward or -1 for reverse."""
    way = torch.atan2(moved[:, 1], moved[:, 0])
    still = moved.norm(dim=-1) < 1e-6
    way = way[_nearest_moving(still)]
    gear = 1.0 if _turning(way, first, last) <= _turning(way + math.pi, first, last) else -1.0
    way = way if gear > 0 else way + math.pi
    at = torch.cat([way[:1], way[:-1] + 0.5 * wrapped(way.diff()), way[-1:]])
    yaw = _unwrapped(torch.cat([first[None], at, last[None]]))
    first, at, last = yaw[:1], yaw[1:-1], yaw[-1:]
    share = torch.linspace(0, 1, len(at))
    early = (1 - share / _TURNING_SHARE).clamp_min(0)
    late = (1 - (1 - share) / _TURNING_SHARE).clamp_min(0)
    early, late = (w * w * (3 - 2 * w) for w in (early, late))
    return at + early * (first - at) + late * (last - at), gear


def _turning(way: Tensor, first: Tensor, last: Tensor) -> float:
    """How far a robot turns at both ends of a way [rad]."""
    return (wrapped(way[0] - first).abs() + wrapped(last - way[-1]).abs()).item()


def _nearest_moving(still: Tensor) -> Tensor:
    """For each step the nearest one that moves, itself where none does."""
    index = torch.arange(len(still))
    if bool(still.all()):
        return index
    moving = index[~still]
    return moving[(index[:, None] - moving).abs().argmin(-1)]


def _unwrapped(angles: Float[Tensor, " n"]) -> Float[Tensor, " n"]:
    """The same angles [rad], each within half a turn of the one before it."""
    return torch.cat([angles[:1], angles[:1] + wrapped(angles.diff()).cumsum(0)])
