"""Options of the experiment on whole flights."""

from dataclasses import dataclass
from typing import Literal

from nerfnav.core.errors import require_not_negative
from nerfnav.navigation import WorldName

EndsChoice = Literal["tasks", "random", "both"]
"""Which ends are flown between."""


@dataclass(frozen=True)
class FlightOptions:
    """What is flown, and how much the robot is told."""

    ends: EndsChoice = "both"
    """The tasks of the place in turn, ends drawn at random, or the two by turns."""
    world: WorldName = "paper"
    """The paper's noise, or the physical world, in which other robots than quadrotors do not fly."""
    risk: float | None = None
    """What a collision that noise brings about costs [J], as `nerfnav fly --risk` has it; None: as flights have it."""
    truth: bool = False
    """Whether each flight is flown a second time with the state known: what the noise alone costs."""
    robot: str | None = None
    """Name or file of the robot that flies what is asked of robots of its kind; None: those that the tasks are for, and
    the paper's between random ends."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for a risk that is no weight."""
        require_not_negative(risk=self.risk)
