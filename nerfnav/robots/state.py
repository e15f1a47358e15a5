"""One state for all robots, its tangent space, and a motion as a sequence of states and actions.

Notation: x = (p, v, R, w) with position p and velocity v in the world, attitude R = R_world_body, body rate w in the
body. The tangent of x has 12 numbers in this order: dp [m], dv [m/s], dtheta [rad], dw [rad/s], with
x (+) d = (p + dp, v + dv, R Exp(dtheta), w + dw).
"""

from collections.abc import Sequence
from dataclasses import dataclass

import torch
from jaxtyping import Float, Int
from torch import Tensor

from nerfnav.core.structs import TensorStruct
from nerfnav.geometry import Pose, so3

TANGENT = 12
"""Length of a tangent vector of RigidState."""
POSITION, VELOCITY, ATTITUDE, BODY_RATE = slice(0, 3), slice(3, 6), slice(6, 9), slice(9, 12)
"""Slices of the parts in a tangent vector."""


@dataclass(frozen=True)
class RigidState(TensorStruct):
    """A rigid body's pose and velocities, with any batch shape."""

    position: Float[Tensor, "*batch 3"]
    """p, in the world [m]."""
    velocity: Float[Tensor, "*batch 3"]
    """v, in the world [m/s]."""
    rotation: Float[Tensor, "*batch 3 3"]
    """R_world_body."""
    body_rate: Float[Tensor, "*batch 3"]
    """w, in the body's axes [rad/s]."""

    @classmethod
    def at_rest(cls, position: Sequence[float], yaw: float = 0.0) -> "RigidState":
        """Make a level state without motion at `position` [m], heading `yaw` [rad]."""
        zero = torch.zeros(3)
        return cls(torch.tensor(position, dtype=torch.float32), zero, so3.from_yaw(torch.tensor(float(yaw))), zero)

    @property
    def pose(self) -> Pose:
        """Return the pose T_world_body."""
        return Pose(self.rotation, self.position)

    def moved_to(self, pose: Pose) -> "RigidState":
        """Move the body to another pose T_world_body; its motion stays in its own axes: R^T v and w stay as they
        are."""
        turn_world = pose.rotation @ self.rotation.transpose(-1, -2)
        velocity_world = (turn_world @ self.velocity[..., None])[..., 0]
        return RigidState(pose.position, velocity_world, pose.rotation, self.body_rate)

    def retract(self, tangent: Float[Tensor, "*batch 12"]) -> "RigidState":
        """Compute x (+) tangent."""
        return RigidState(
            self.position + tangent[..., POSITION],
            self.velocity + tangent[..., VELOCITY],
            so3.retract(self.rotation, tangent[..., ATTITUDE]),
            self.body_rate + tangent[..., BODY_RATE],
        )

    def local(self, other: "RigidState") -> Float[Tensor, "*batch 12"]:
        """Compute other (-) x: the tangent d at this state with x (+) d = other."""
        return torch.cat(
            [
                other.position - self.position,
                other.velocity - self.velocity,
                so3.local(self.rotation, other.rotation),
                other.body_rate - self.body_rate,
            ],
            -1,
        )


@dataclass(frozen=True)
class Motion(TensorStruct):
    """States at times 0, dt, ..., N dt and the actions between them."""

    states: RigidState
    """Batch shape (..., N + 1)."""
    actions: Float[Tensor, "*batch n a"]
    """Action of each of the N steps, as the robot's `action_names` say."""
    dt: float
    """Length of a step [s]."""

    def left_after(self, steps: int) -> "Motion":
        """Return the rest of one motion after so many of its steps."""
        return Motion(self.states[steps:], self.actions[steps:], self.dt)


def interpolate_poses(
    states: RigidState, spacing: float, rotation_spacing: float
) -> tuple[RigidState, Int[Tensor, " n"]]:
    """Interpolate states, batch shape (n,), so that neighbours are at most `spacing` [m] and `rotation_spacing` [rad]
    apart: straight lines, steady turns.

    Return them with the indices at which the given states stand among them.
    """
    turn = so3.local(states[:-1].rotation, states[1:].rotation)
    way = states.position.diff(dim=0).norm(dim=-1)
    parts = torch.maximum(way / spacing, turn.norm(dim=-1) / rotation_spacing)
    return _blend(states, turn, parts.ceil().clamp_min(1).long())


def divide_steps(states: RigidState, parts: int) -> RigidState:
    """Interpolate states, batch shape (n,), in so many equal parts between neighbours: straight lines, steady turns."""
    turn = so3.local(states[:-1].rotation, states[1:].rotation)
    return _blend(states, turn, torch.full((len(turn),), parts))[0]


def _blend(
    states: RigidState, turn: Float[Tensor, "n_1 3"], counts: Int[Tensor, " n_1"]
) -> tuple[RigidState, Int[Tensor, " n"]]:
    """Interpolate in each step as many equal parts as its count; return the given states' indices, too."""
    before, after = states[:-1], states[1:]
    segment = torch.arange(len(counts)).repeat_interleave(counts)
    starts = torch.cat([torch.zeros(1, dtype=torch.long), counts.cumsum(0)])
    share = ((torch.arange(len(segment)) - starts[segment]).to(turn) / counts[segment].to(turn))[:, None]

    def blend(first: Tensor, second: Tensor) -> Tensor:
        return first[segment] + share * (second - first)[segment]

    between = RigidState(
        blend(before.position, after.position),
        blend(before.velocity, after.velocity),
        so3.retract(before.rotation[segment], share * turn[segment]),
        blend(before.body_rate, after.body_rate),
    )
    return RigidState.cat([between, states[-1:]]), starts
