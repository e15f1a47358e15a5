"""What a person may change about plans: how long they take, and what their cost weighs."""

from dataclasses import dataclass, field, fields, replace

from nerfnav.errors import InvalidInputError
from nerfnav.field import Unknown
from nerfnav.planner import CostWeights, PlannerConfig, planners

_SHORTEST_S, LONGEST_S = 0.5, 600.0
_HEAVIEST, _MOST_SAMPLES, _WIDEST_M = 1e6, 16, 0.2


@dataclass(frozen=True)
class PlanSettings:
    """How long plans take, and what they weigh."""

    duration_s: float = 2.0
    """How long the robot may take from start to goal [s]."""
    shortest: bool = False
    """Whether to find the shortest duration that keeps the robot's limits instead."""
    max_collision: float | None = None
    """Largest bound on the probability of a collision that is accepted, 0 to 1; None accepts any."""
    unknown: Unknown = Unknown.OCCUPIED
    """What space is taken for that no camera ever saw into."""
    weights: CostWeights = field(default_factory=CostWeights)
    """What the terms of J weigh."""

    def lasting(self, seconds: float) -> "PlanSettings":
        """The same with this duration [s], and none to be found."""
        return replace(self, duration_s=seconds, shortest=False)

    def check(self) -> None:
        """Raise InvalidInputError for numbers that no plan can have: they are typed, and the notice tells the range."""
        if not _SHORTEST_S <= self.duration_s <= LONGEST_S:
            raise InvalidInputError(f"the duration must be from {_SHORTEST_S:g} to {LONGEST_S:g} s")
        if self.max_collision is not None and not 0 < self.max_collision <= 1:
            raise InvalidInputError("the accepted risk must be above 0 % and at most 100 %")
        most = {"samples_per_step": _MOST_SAMPLES, "margin": _WIDEST_M}
        for part in fields(self.weights):
            value, largest = getattr(self.weights, part.name), most.get(part.name, _HEAVIEST)
            least = 1 if part.name == "samples_per_step" else 0
            if not least <= value <= largest:
                raise InvalidInputError(f"{part.name.replace('_', ' ')} must be from {least:g} to {largest:g}")

    def config(self, planner: str, own: PlannerConfig | None) -> PlannerConfig | None:
        """The planner's settings with these weights; `own` where nobody changed the weights."""
        if self.weights == CostWeights():
            return own
        return replace(planners.load(planner).config() if own is None else own, weights=self.weights)
