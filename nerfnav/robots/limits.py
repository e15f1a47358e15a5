"""Limits of a robot: its bounds, how much of each a motion uses, and the penalty on their excess."""

from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.robots.robot import Robot
from nerfnav.robots.state import Motion

_TOLERANCE = 1e-3
"""Share of a bound by which it may be exceeded unnoticed: penalties end a little beyond."""


@dataclass(frozen=True)
class LimitUse:
    """How much of a limit a motion uses."""

    name: str
    """What is limited."""
    unit: str
    """Its unit."""
    least: float
    """Smallest value over the motion."""
    most: float
    """Largest value over the motion."""
    lower: float | None
    """Smallest value allowed; None where nothing is too small."""
    upper: float | None
    """Largest value allowed; None where nothing is too large."""

    @property
    def violated(self) -> bool:
        """Whether the motion leaves the allowed range."""
        span = _TOLERANCE * max(abs(self.lower or 0.0), abs(self.upper or 0.0))
        below = self.lower is not None and self.least < self.lower - span
        return below or (self.upper is not None and self.most > self.upper + span)


def limit_uses(robot: Robot, motion: Motion) -> tuple[LimitUse, ...]:
    """What one motion asks of each of the robot's bounds."""
    asked = robot.demands(motion)
    return tuple(
        LimitUse(
            bound.name,
            bound.unit,
            asked[bound.name].min().item(),
            asked[bound.name].max().item(),
            bound.lower,
            bound.upper,
        )
        for bound in robot.bounds
    )


def penalty(robot: Robot, motion: Motion) -> Float[Tensor, "*batch"]:
    """Squared excess over each bound, as a share of the bound, summed over bounds and steps; 0 within them.

    Smooth to the first derivative, so that any planner can weigh it.
    """
    total = motion.actions.new_zeros(motion.actions.shape[:-2])
    for bound in robot.bounds:
        asked = robot.demands(motion)[bound.name]
        scale = max(abs(edge) for edge in (bound.lower, bound.upper) if edge is not None)
        if bound.upper is not None:
            total = total + ((asked - bound.upper) / scale).clamp_min(0).square().sum(-1)
        if bound.lower is not None:
            total = total + ((bound.lower - asked) / scale).clamp_min(0).square().sum(-1)
    return total


def speed(motion: Motion) -> Float[Tensor, "*batch times"]:
    """|v| at each time [m/s]."""
    return length(motion.states.velocity)


def length(vectors: Float[Tensor, "*batch k"]) -> Float[Tensor, "*batch"]:
    """Euclidean length with a finite derivative at zero."""
    return torch.sqrt(vectors.square().sum(-1) + 1e-16)
