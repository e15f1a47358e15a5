"""A flight that never happened: along a climbing curve, rolling and yawing, the belief beside the truth."""

import torch

from nerfnav.estimator.belief import Belief
from nerfnav.export.recording import Recording
from nerfnav.geometry import so3
from nerfnav.navigation.steps import EpisodeOutcome, NavigationStep
from nerfnav.robots.quadrotor import Quadrotor
from nerfnav.robots.state import Motion, RigidState

DT = 0.1


def curve(steps: int = 16) -> Motion:
    """A motion along a helix; its velocities are the derivatives of its positions."""
    t = DT * torch.arange(steps + 1, dtype=torch.float32)
    zero = torch.zeros_like(t)
    position = torch.stack([t.cos(), t.sin(), 0.3 * t], -1)
    velocity = torch.stack([-t.sin(), t.cos(), 0.3 + zero], -1)
    rotation = so3.from_yaw(3.0 + t) @ so3.exp(torch.stack([0.2 * t, zero, zero], -1))
    states = RigidState(position, velocity, rotation, torch.stack([0.2 + zero, zero, 1.0 + zero], -1))
    return Motion(states, torch.zeros(steps, 4), DT)


def flown(steps: int = 16, size: int = 12) -> tuple[NavigationStep, ...]:
    """The steps of a flight along the curve, with pictures of `size` pixels; it touched something on the way."""
    motion, generator = curve(steps), torch.Generator().manual_seed(0)
    made = []
    for index in range(steps + 1):
        truth = motion.states[index]
        factor = 0.02 * torch.randn(12, 12, generator=generator)
        belief = Belief(truth.retract(0.02 * torch.randn(12, generator=generator)), factor @ factor.T)
        image = torch.full((size, size, 3), 7 * index, dtype=torch.uint8) if index else None
        rest = Motion(motion.states[index:], motion.actions[index:], DT)
        outcome = EpisodeOutcome.COLLIDED if index == steps else None
        made.append(
            NavigationStep(
                index, index * DT, torch.full((4,), float(index)) if index else None, truth, belief, image, None, rest,
                index == 3, 12.5, 3.25, outcome,
            )
        )
    return tuple(made)


def flight(steps: int = 16) -> Recording:
    """The flight as formats take it."""
    return Recording.of_flight(flown(steps), Quadrotor(), "a helix")


def plan(steps: int = 16) -> Recording:
    """The curve as a plan."""
    return Recording.of_plan(curve(steps), Quadrotor(), "a helix")
