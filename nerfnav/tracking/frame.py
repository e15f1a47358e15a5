"""Frame: picture and time of exposure; inertial measurements, the protocol of sources, and the result of tracking."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import Enum
from typing import Protocol, runtime_checkable

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.estimator import Belief
from nerfnav.estimator.core.belief import POSE
from nerfnav.geometry import Camera, Pose, so3
from nerfnav.inertial import ImuNoise


@dataclass(frozen=True)
class Frame:
    """Picture with its time."""

    time: float
    """Time of the exposure [s], on the source's own clock."""
    picture: UInt8[Tensor, "height width 3"]
    """RGB, upright as the sensor gives it."""
    name: str
    """Name in the source: that of a file, or "frame 12"."""

    def require_after(self, before: float | None) -> None:
        """Raise InvalidInputError where the frame before it, if any, was not taken `before` it [s]."""
        if before is not None and not self.time > before:
            raise InvalidInputError(
                f"{self.name} was taken at {self.time:g} s, not after the frame before it ({before:g} s): "
                "frames come in the order of their times"
            )


@dataclass(frozen=True)
class ImuMeasurements:
    """Measurements of an inertial measurement unit, oldest first."""

    times: Float[Tensor, " n"]
    """Times [s], float64, on the clock of the frames."""
    body_rates: Float[Tensor, "n 3"]
    """Gyroscope [rad/s], in its own axes."""
    specific_forces: Float[Tensor, "n 3"]
    """Accelerometer: acceleration less gravity [m/s^2], in its own axes."""
    mount: Pose | None = None
    """T_imu_camera, the camera OpenGL; None where the source does not give it."""
    noise: ImuNoise = field(default_factory=ImuNoise)
    """Noise of the unit, as far as the source gives it."""

    def finite(self, source: str) -> "ImuMeasurements":
        """Return itself. Raises InvalidInputError, which names the source, for a number that is not finite."""
        if not all(part.isfinite().all() for part in (self.times, self.body_rates, self.specific_forces)):
            raise InvalidInputError(f"{source} has measurements that are no finite numbers")
        return self


def mount_of(matrix: np.ndarray) -> Pose:
    """Convert a matrix (4, 4) in the usual axes of cameras (x right, y down, z ahead) to a mount."""
    given = torch.from_numpy(np.ascontiguousarray(matrix, dtype=np.float64))
    return Pose((given[:3, :3] * torch.tensor([1.0, -1.0, -1.0])).float(), given[:3, 3].float())


@runtime_checkable
class FrameSource(Protocol):
    """Pictures in the order of their times, read one at a time."""

    @property
    def camera(self) -> Camera | None:
        """Camera of the pictures; None where the source does not describe it."""
        ...

    @property
    def inertial(self) -> ImuMeasurements | None:
        """Inertial measurements of the same time, if any."""
        ...

    @property
    def count(self) -> int | None:
        """Number of frames; None where it is unknown before they are read."""
        ...

    def frames(self) -> Iterator[Frame]:
        """Yield each frame. Raises InvalidInputError where one cannot be read, or where time runs backwards."""
        ...


class TrackStatus(Enum):
    """Status of a frame; the value is the user's text."""

    SEARCHING = "nothing is known yet: no one place looks like the picture"
    FOUND = "found by global localization"
    FOLLOWED = "followed by the picture"
    PREDICTED = "the picture said nothing or disagreed: the motion model alone leads"
    LOST = "the track is lost: pictures disagree, and no one place looks like them"
    FOUND_AGAIN = "the track was lost, and found again by looking everywhere"

    @property
    def knows(self) -> bool:
        """True where there is a pose."""
        return self not in (TrackStatus.SEARCHING, TrackStatus.LOST)

    @property
    def updated(self) -> bool:
        """True where the frame's own picture gave the pose."""
        return self in (TrackStatus.FOUND, TrackStatus.FOLLOWED, TrackStatus.FOUND_AGAIN)


@dataclass(frozen=True)
class TrackedFrame:
    """Pose of the camera at the time of a frame, with its covariance."""

    time: float
    """Time of the frame [s]."""
    name: str
    """Name of the frame."""
    status: TrackStatus
    """Status of the frame."""
    belief: Belief | None
    """State of the camera's carrier in the field's frame; None while nothing is known."""
    mount: Pose
    """T_body_camera."""
    ms: float
    """Computing time [ms]."""
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
