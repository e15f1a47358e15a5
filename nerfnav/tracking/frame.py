"""Frames and inertial measurements, each with its time, and the protocol of their sources."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

import numpy as np
import torch
from jaxtyping import Float, UInt8
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import Camera, Pose
from nerfnav.inertial import ImuNoise


@dataclass(frozen=True)
class Frame:
    """A picture and when it was taken."""

    time: float
    """Of its exposure [s], on the source's own clock."""
    picture: UInt8[Tensor, "height width 3"]
    """What was seen: RGB, upright as the sensor gives it."""
    name: str
    """What the source calls it: a file's name, or "frame 12"."""

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
    """When they were taken [s], float64, on the clock of the frames."""
    body_rates: Float[Tensor, "n 3"]
    """What the gyroscope said [rad/s], in its own axes."""
    specific_forces: Float[Tensor, "n 3"]
    """What the accelerometer said: acceleration less gravity [m/s^2], in its own axes."""
    mount: Pose | None = None
    """T_imu_camera, the camera OpenGL, where the source says so."""
    noise: ImuNoise = field(default_factory=ImuNoise)
    """Of the unit, as far as the source says."""

    def finite(self, source: str) -> "ImuMeasurements":
        """Itself. Raises InvalidInputError, which names the source, where a number is not finite."""
        if not all(part.isfinite().all() for part in (self.times, self.body_rates, self.specific_forces)):
            raise InvalidInputError(f"{source} has measurements that are no finite numbers")
        return self


def mount_of(matrix: np.ndarray) -> Pose:
    """The mount of a camera that a matrix (4, 4) tells in the usual axes of cameras: x right, y down, z ahead."""
    told = torch.from_numpy(np.ascontiguousarray(matrix, dtype=np.float64))
    return Pose((told[:3, :3] * torch.tensor([1.0, -1.0, -1.0])).float(), told[:3, 3].float())


@runtime_checkable
class FrameSource(Protocol):
    """Pictures in the order of their times, read one at a time."""

    @property
    def camera(self) -> Camera | None:
        """What took them, where the source says so."""
        ...

    @property
    def inertial(self) -> ImuMeasurements | None:
        """What an inertial measurement unit said meanwhile, where there was one."""
        ...

    @property
    def count(self) -> int | None:
        """How many frames there are, where that is known before they are read."""
        ...

    def frames(self) -> Iterator[Frame]:
        """Each frame. Raises InvalidInputError where one cannot be read, or where time runs backwards."""
        ...
