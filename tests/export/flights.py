"""A flight that never happened: along a climbing curve, rolling and yawing, the belief beside the truth."""

import torch

from nerfnav.estimator.core.belief import Belief
from nerfnav.export.recording import Recording, Subject
from nerfnav.geometry import so3
from nerfnav.navigation.episode import EpisodeOutcome, NavigationStep
from nerfnav.planner import PlanOutcome
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
        image = torch.full((size, size, 3), 7 * index % 256, dtype=torch.uint8) if index else None
        rest = Motion(motion.states[index:], motion.actions[index:], DT)
        outcome = EpisodeOutcome.COLLIDED if index == steps else None
        made.append(
            NavigationStep(
                index, index * DT, torch.full((4,), float(index)) if index else None, truth, belief, image, None, rest,
                index == 3, 12.5, 3.25, outcome,
            )
        )
    return tuple(made)


def flight(steps: int = 16, size: int = 12, subject: Subject = Subject.EXECUTED) -> Recording:
    """The flight as formats take it."""
    return Recording.of_flight(flown(steps, size), Quadrotor(), "a helix", subject=subject)


def arrived(motion: Motion) -> tuple[NavigationStep, ...]:
    """The steps of a flight along a motion that arrived, its first plan among them, the truth off by 1 cm of noise."""
    generator, made, last = torch.Generator().manual_seed(1), [], len(motion.actions)
    for index in range(last + 1):
        truth = motion.states[index].retract(0.01 * torch.randn(12, generator=generator))
        belief = Belief(truth.retract(0.005 * torch.randn(12, generator=generator)), 2.5e-5 * torch.eye(12))
        rest = Motion(motion.states[index:], motion.actions[index:], motion.dt)
        step = NavigationStep(
            index, index * motion.dt, motion.actions[index - 1] if index else None, truth, belief, None, None, rest,
            False, 1.0, 1.0, EpisodeOutcome.REACHED if index == last else None,
            first_plan=None if index else motion,
        )  # fmt: skip
        made.append(step)
    return tuple(made)


def plan(steps: int = 16) -> Recording:
    """The curve as a plan."""
    return Recording.of_plan(curve(steps), Quadrotor(), "a helix")


def hover_to_hover(steps: int = 20) -> Recording:
    """A plan between two states at rest, around a corner, a metre and a half in 2 s: as explicit Euler has it, the
    first step does not move, and each velocity is that of the way to the next position."""
    dt = max(DT, 2.0 / steps)
    share = ((torch.arange(steps + 1) - 1).clamp_min(0) / (steps - 1))[:, None]
    ease = share**4 * (35 - 84 * share + 70 * share**2 - 20 * share**3)
    position = torch.tensor([0.0, 0.0, 0.5]) + ease * torch.tensor([1.2, 0.6, 0.4])
    position = position + torch.tensor([0.0, 0.25, 0.1]) * torch.sin(torch.pi * ease)
    velocity = torch.cat([position.diff(dim=0) / dt, torch.zeros(1, 3)])
    yaw = 0.5 * ease[:, 0]
    rate = torch.cat([torch.zeros(steps + 1, 2), torch.cat([yaw.diff() / dt, torch.zeros(1)])[:, None]], -1)
    states = RigidState(position, velocity, so3.from_yaw(yaw), rate)
    return Recording.of_plan(Motion(states, torch.zeros(steps, 4), dt), Quadrotor(), "a corner", PlanOutcome.CONVERGED)
