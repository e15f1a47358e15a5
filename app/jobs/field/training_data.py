"""What a field is trained from, whatever it was made of: photographs, a box, and what is known about them."""

from collections.abc import Generator
from dataclasses import dataclass

from jaxtyping import Float
from torch import Tensor

from nerfnav.core.errors import NerfnavError
from nerfnav.geometry import Box, PosedImages
from nerfnav.world import Scene
from nerfnav_app.jobs.events import JobEvent


class StoppedError(NerfnavError):
    """A job that was stopped before there was anything to keep."""


@dataclass(frozen=True, eq=False)
class TrainingData:
    """Ready to train from."""

    learned: PosedImages
    """Photographs that the field learns from."""
    held_out: PosedImages
    """Photographs that judge it: it never sees them."""
    box: Box
    """Where the field lives."""
    background: Float[Tensor, "3"]
    """sRGB colour of rays that nothing stops, in [0, 1]."""
    truth: Scene | None
    """The ground truth, where there is one."""
    report: dict[str, object]
    """What `nerfnav train --json` tells about the source: its kind, what was used, what was guessed."""
    voxel: float | None = None
    """Distance of nodes that suits it [m]; None: TrainConfig's."""
    iterations: int | None = None
    """Training steps that it asks for; None: TrainConfig's."""
    bounded: bool = True
    """Whether all that the photographs show, but for the background's colour, lies in the box."""

    camera: tuple[float, ...] = ()
    """What took the photographs, as `Camera.numbers` has it; empty where that is not worth noting."""
    placed: tuple[float, ...] = ()
    """How the field lies in the capture, as `Similarity.numbers` has it; empty where there is none."""

    @property
    def guesses(self) -> tuple[str, ...]:
        """What was guessed, sentences."""
        told = self.report.get("guesses", ())
        return tuple(map(str, told)) if isinstance(told, list | tuple) else ()


Gathering = Generator[JobEvent, bool | None, TrainingData]
"""Training data in the making: yields progress, and returns it. Send True to stop early."""
