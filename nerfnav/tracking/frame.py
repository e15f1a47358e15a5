"""What is tracked: pictures and inertial measurements, each with the time at which it was taken."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from jaxtyping import Float, UInt8
from torch import Tensor

from nerfnav.geometry import Camera


@dataclass(frozen=True)
class Frame:
    """A picture and when it was taken."""

    time: float
    """Of its exposure [s], on the source's own clock."""
    picture: UInt8[Tensor, "height width 3"]
    """What was seen: RGB, upright as the sensor gives it."""
    name: str
    """What the source calls it: a file's name, or "frame 12"."""


@dataclass(frozen=True)
class Inertial:
    """Measurements of an inertial measurement unit, oldest first."""

    times: Float[Tensor, " n"]
    """When they were taken [s], float64, on the clock of the frames."""
    body_rates: Float[Tensor, "n 3"]
    """What the gyroscope said [rad/s], in its own axes."""
    specific_forces: Float[Tensor, "n 3"]
    """What the accelerometer said: acceleration less gravity [m/s^2], in its own axes."""


@runtime_checkable
class FrameSource(Protocol):
    """Pictures in the order of their times, read one at a time."""

    @property
    def camera(self) -> Camera | None:
        """What took them, where the source says so."""
        ...

    @property
    def inertial(self) -> Inertial | None:
        """What an inertial measurement unit said meanwhile, where there was one."""
        ...

    @property
    def count(self) -> int | None:
        """How many frames there are, where that is known before they are read."""
        ...

    def frames(self) -> Iterator[Frame]:
        """Each frame. Raises InvalidInputError where one cannot be read, or where time runs backwards."""
        ...
