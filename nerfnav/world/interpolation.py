"""Poses between the states of a motion: straight lines, steady turns."""

from dataclasses import dataclass

import torch
from jaxtyping import Int
from torch import Tensor

from nerfnav.geometry import so3
from nerfnav.robots import RigidState


@dataclass(frozen=True)
class ContactConfig:
    """How densely a motion is judged."""

    spacing: float = 0.005
    """Largest distance between neighbouring poses [m]."""
    rotation_spacing: float = 0.02
    """Largest angle between neighbouring poses [rad]."""


def interpolate_poses(states: RigidState, config: ContactConfig | None = None) -> RigidState:
    """The states of a motion, batch shape (n + 1,), and enough between them: straight lines, steady turns."""
    return interpolated(states, config or ContactConfig())[0]


def interpolated(states: RigidState, config: ContactConfig) -> tuple[RigidState, Int[Tensor, " k"]]:
    """The dense states, and where among them the given ones stand."""
    before, after = states[:-1], states[1:]
    turn = so3.local(before.rotation, after.rotation)
    way = (after.position - before.position).norm(dim=-1)
    parts = torch.maximum(way / config.spacing, turn.norm(dim=-1) / config.rotation_spacing)
    counts = parts.ceil().clamp_min(1).long()
    segment = torch.arange(len(counts)).repeat_interleave(counts)
    starts = torch.cat([torch.zeros(1, dtype=torch.long), counts.cumsum(0)])
    share = ((torch.arange(len(segment)) - starts[segment]) / counts[segment])[:, None].to(way)

    def blend(first: Tensor, second: Tensor) -> Tensor:
        return first[segment] + share * (second - first)[segment]

    between = RigidState(
        blend(before.position, after.position),
        blend(before.velocity, after.velocity),
        so3.retract(before.rotation[segment], share * turn[segment]),
        blend(before.body_rate, after.body_rate),
    )
    return RigidState.cat([between, states[-1:]]), starts
