"""What to do when the picture disagrees with the belief: doubt it more, then look for the robot everywhere.

A filter that rejects a picture (its innovation or its residual fails the test) hands the prediction back. The belief
is then widened, so that the next picture may move it further; when several pictures in a row were rejected, a
relocaliser searches the whole field, and the belief begins anew where it finds the robot.
"""

from collections.abc import Generator, Iterator
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Protocol, runtime_checkable

import torch
from jaxtyping import UInt8
from torch import Tensor

from nerfnav.estimator.belief import Belief
from nerfnav.estimator.noise import StateNoise
from nerfnav.estimator.relocalise import RelocaliseOutcome, RelocaliseStep
from nerfnav.geometry.camera import Pose
from nerfnav.robots.state import RigidState


@runtime_checkable
class Relocaliser(Protocol):
    """Anything that finds a camera from one picture alone."""

    def relocalise(self, image: UInt8[Tensor, "height width 3"]) -> Iterator[RelocaliseStep]:
        """Search; the last step has the outcome."""
        ...


class Recovery(Enum):
    """What was done about a picture that disagreed; the value is what a user reads."""

    WIDENED = "the picture disagreed: the belief was widened"
    RELOCALISED = "the robot was lost, and found again by looking everywhere"
    LOST = "the robot was lost, and not found again"


@dataclass(frozen=True)
class RecoveryConfig:
    """When to doubt and when to search."""

    patience: int = 3
    """Pictures in a row that may disagree before the robot counts as lost."""
    widen: float = 1.7
    """Factor on all standard deviations of the belief for each picture that disagrees."""
    found: StateNoise = field(default_factory=lambda: StateNoise(0.02, 2.0, 0.02, 3.0))
    """Spread of the belief after the robot was found: its pose is known well, its velocities hardly, for it was flown
    on a wrong belief; a tenth of this on the rates, and the next pictures are rejected again."""


def recover(
    belief: Belief, image: Tensor, lost: int, config: RecoveryConfig, relocaliser: Relocaliser | None
) -> Generator[RelocaliseStep, None, tuple[Belief, Recovery]]:
    """The belief to go on with after `lost` pictures in a row disagreed, and what was done.

    Yields the steps of a search, if there is one.
    """
    if lost < config.patience:
        return replace(belief, covariance=belief.covariance * config.widen**2), Recovery.WIDENED
    if relocaliser is None:
        return belief, Recovery.LOST
    step = None
    for step in relocaliser.relocalise(image):
        yield step
    assert step is not None, "a search yields at least one step"
    if step.outcome is not RelocaliseOutcome.FOUND:
        return belief, Recovery.LOST
    return belief_at(step.body_pose(), belief.mean, config.found), Recovery.RELOCALISED


def belief_at(pose: Pose, before: RigidState, noise: StateNoise) -> Belief:
    """A belief at a pose T_world_body, with the velocities that were believed before."""
    mean = RigidState(pose.position, before.velocity, pose.rotation, torch.zeros_like(before.body_rate))
    return Belief(mean, noise.covariance())
