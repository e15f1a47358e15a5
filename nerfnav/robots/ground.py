"""Ground robots: level states at one height, and headings along a path, forward or in reverse."""

import math

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import so3
from nerfnav.robots.robot import Robot, penalty
from nerfnav.robots.state import Motion, RigidState

LEVEL = 1e-3
"""Tilt [rad], height [m] and vertical speed [m/s] that count as none."""


class GroundRobot(Robot):
    """Robot that stays level, at the height of its start."""

    planar = True

    def limits(self, motion: Motion) -> Float[Tensor, "*batch"]:
        """Sum the squared excess over the bounds."""
        return penalty(self, motion)

    def settled(self, state: RigidState, before: RigidState) -> RigidState:
        """Project a state to the nearest one that is level and moves in the plane, at the height of `before`."""
        return RigidState(
            spatial(state.position[..., :2], before.position[..., 2]),
            spatial(state.velocity[..., :2], 0.0),
            so3.from_yaw(heading(state)),
            about_z(state.body_rate[..., 2]),
        )

    def check_ends(self, start: RigidState, goal: RigidState) -> None:
        """Raise InvalidInputError unless both ends are level and at one height."""
        for which, state in (("start", start), ("goal", goal)):
            tilted = state.rotation[..., 2, 2] < 1 - LEVEL
            rising = state.velocity[..., 2].abs() > LEVEL
            rolling = state.body_rate[..., :2].abs().amax(-1) > LEVEL
            if bool((tilted | rising | rolling).any()):
                raise InvalidInputError(
                    f"a {self.name} moves on the ground: its {which} must be level and stay at its height"
                )
        if bool(((goal.position - start.position)[..., 2].abs() > LEVEL).any()):
            raise InvalidInputError(
                f"a {self.name} stays at the height of its start, {start.position[..., 2].item():.3f} m: "
                f"the goal cannot be at {goal.position[..., 2].item():.3f} m"
            )


def wrap_angle(angle: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch"]:
    """Wrap an angle [rad] to -pi to pi."""
    return torch.atan2(torch.sin(angle), torch.cos(angle))


def spatial(planar: Float[Tensor, "*batch 2"], third: float | Tensor) -> Float[Tensor, "*batch 3"]:
    """Give vectors of the plane a third coordinate."""
    column = torch.as_tensor(third, dtype=planar.dtype, device=planar.device).expand(planar.shape[:-1])
    return torch.cat([planar, column[..., None]], -1)


def about_z(rate: Float[Tensor, "*batch"]) -> Float[Tensor, "*batch 3"]:
    """Make body rates of a robot that only turns about z."""
    zero = torch.zeros_like(rate)
    return torch.stack([zero, zero, rate], -1)


def heading(state: RigidState) -> Float[Tensor, "*batch"]:
    """Return the yaw of a level state [rad]."""
    return so3.yaw_of(state.rotation)


def row(value: Tensor, batch: torch.Size) -> Tensor:
    """Make a number or vector one entry of a (batch, time, ...) table."""
    return value.expand(torch.Size([*batch, *value.shape])).unsqueeze(len(batch))


def forward_speed(state: RigidState) -> Float[Tensor, "*batch"]:
    """Compute the forward speed s [m/s], negative in reverse."""
    return (state.rotation[..., 0] * state.velocity).sum(-1)


_TURNING_SHARE = 0.25
"""Share of the path over which headings turn from the start's to the path's, and at the end to the goal's."""
_STILL = 0.2
"""Share of the mean step below which a step's direction does not count."""


def headings_along(
    moved: Float[Tensor, "n 2"], first: Float[Tensor, ""], last: Float[Tensor, ""]
) -> tuple[Float[Tensor, " times"], float]:
    """Compute headings [rad] at each time for a robot whose steps move it by `moved` [m], between those at its ends.

    Also 1 for forward or -1 for reverse, whichever takes less turning at the ends.
    """
    steps = moved.norm(dim=-1)
    way = torch.atan2(moved[:, 1], moved[:, 0])[_nearest_moving(steps <= _STILL * steps.mean())]
    gear = 1.0 if _turning(way, first, last) <= _turning(way + math.pi, first, last) else -1.0
    way = way if gear > 0 else way + math.pi
    at = torch.cat([way[:1], way[:-1] + 0.5 * wrap_angle(way.diff()), way[-1:]])
    yaw = unwrap_angles(torch.cat([first[None], at, last[None]]))
    first, at, last = yaw[:1], yaw[1:-1], yaw[-1:]
    share = torch.linspace(0, 1, len(at)).to(at)
    early = (1 - share / _TURNING_SHARE).clamp_min(0)
    late = (1 - (1 - share) / _TURNING_SHARE).clamp_min(0)
    early, late = (w * w * (3 - 2 * w) for w in (early, late))
    return at + early * (first - at) + late * (last - at), gear


def unwrap_angles(angles: Float[Tensor, " n"]) -> Float[Tensor, " n"]:
    """Unwrap angles [rad]: each within half a turn of the one before it."""
    return torch.cat([angles[:1], angles[:1] + wrap_angle(angles.diff()).cumsum(0)])


def _turning(way: Tensor, first: Tensor, last: Tensor) -> float:
    """Measure the turns of a robot at both ends of a path [rad]."""
    return (wrap_angle(way[0] - first).abs() + wrap_angle(last - way[-1]).abs()).item()


def _nearest_moving(still: Tensor) -> Tensor:
    """Find for each step the nearest one that moves, itself where none does."""
    index = torch.arange(len(still))
    if bool(still.all()):
        return index
    moving = index[~still]
    return moving[(index[:, None] - moving).abs().argmin(-1)]
