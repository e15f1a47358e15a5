"""Options of the experiment on whole flights."""

from dataclasses import dataclass
from typing import Literal

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
    truth: bool = False
    """Whether each flight is flown a second time with the state known: what the noise alone costs."""
