"""Tracking result of one frame: status, pose of the camera, and its covariance."""


from dataclasses import dataclass
from enum import Enum

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.estimator import Belief
from nerfnav.estimator.core.covariance import POSE
from nerfnav.geometry import Pose, so3


class TrackStatus(Enum):
    """What became of a frame; the value is what a user reads."""

    SEARCHING = "nothing is known yet: no one place looks like the picture"
    FOUND = "found from nothing, by looking everywhere"
    FOLLOWED = "followed by the picture"
    PREDICTED = "the picture said nothing or disagreed: the motion model alone leads"
    LOST = "the track is lost: pictures disagree, and no one place looks like them"
    FOUND_AGAIN = "the track was lost, and found again by looking everywhere"

    @property
    def knows(self) -> bool:
        """Whether there is a pose."""
        return self not in (TrackStatus.SEARCHING, TrackStatus.LOST)

    @property
    def updated(self) -> bool:
        """Whether the frame's own picture gave the pose."""
        return self in (TrackStatus.FOUND, TrackStatus.FOLLOWED, TrackStatus.FOUND_AGAIN)


@dataclass(frozen=True)
class TrackedFrame:
    """Where the camera was when a frame was taken, and how sure that is."""

    time: float
    """The frame's own [s]."""
    name: str
    """The frame's own."""
    status: TrackStatus
    """What became of it."""
    belief: Belief | None
    """State of the camera's carrier in the field's frame; None while nothing is known."""
    mount: Pose
    """T_body_camera."""
    ms: float
    """Time that it took [ms]."""
    difference: float | None = None
    """Robust root mean square of the colours' differences between picture and field, in [0, 1]; None where none were
    compared."""

    @property
    def pose(self) -> Pose | None:
        """T_world_camera, the world being the field's frame and the camera OpenGL; None while nothing is known."""
        return None if self.belief is None else self.belief.mean.pose.compose(self.mount)

    @property
    def covariance(self) -> Float[Tensor, "6 6"] | None:
        """Of `pose`: position [m], then a turn [rad], both about the field's fixed axes (REP 103); None with it.

        The body's tangent is (dp, dtheta), R Exp(dtheta); a camera at p + R m moves by dp - (R m) x (R dtheta).
        """
        if self.belief is None:
            return None
        rotation = self.belief.mean.rotation.double()
        change = torch.zeros(6, 6, dtype=torch.float64)
        change[:3, :3] = torch.eye(3)
        change[3:, 3:] = rotation
        change[:3, 3:] = -so3.hat(rotation @ self.mount.position.double()) @ rotation
        covariance = self.belief.covariance.double()[POSE][:, POSE]
        return change @ covariance @ change.T
