"""Options of the experiment on whole flights."""

from dataclasses import dataclass
from typing import Literal

from nerfnav.core.errors import require_not_negative
from nerfnav.navigation import WorldName

EndsChoice = Literal["tasks", "random", "both"]
"""Ends that are flown between."""


@dataclass(frozen=True)
class FlightOptions:
    """Ends, world, risk and robot of whole flights."""

    ends: EndsChoice = "both"
    """The tasks of the place in turn, ends drawn at random, or the two by turns."""
    world: WorldName = "paper"
    """The paper's noise, or the physical world, in which other robots than quadrotors do not fly."""
    risk_weight: float | None = None
    """Cost of a collision by noise [J], as of `nerfnav fly --risk-weight`; None: the default of flights."""
    truth: bool = False
    """Fly each flight a second time with the state known: the cost of the noise alone."""
    robot: str | None = None
    """Name or file of the robot that flies what is asked of robots of its kind; None: those that the tasks are for, and
    the paper's between random ends."""
    fly_on: bool = False
    """Fly on after a contact, which is counted, as the paper's evaluation does; else a contact ends the flight."""
    imu: bool = False
    """The robot has an inertial unit in the paper's world too, as of `nerfnav fly --imu`."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for a weight of risk below 0."""
        require_not_negative(risk_weight=self.risk_weight)
