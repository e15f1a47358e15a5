"""Actions of a person on a plan that is not to be flown."""

from dataclasses import dataclass


@dataclass(frozen=True)
class StayDown:
    """Do not fly a plan that is not safe, after all."""


@dataclass(frozen=True)
class AllowTime:
    """Plan again, with more time."""

    seconds: float
    """From start to goal [s]."""


@dataclass(frozen=True)
class RestoreWeights:
    """Plan again, with the weights as they were at first."""


PlanAction = StayDown | AllowTime | RestoreWeights
