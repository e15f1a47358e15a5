"""Planner protocol: the interface of every planner, their common base, and the entry of the registry."""

import dataclasses
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Protocol, TypeVar, runtime_checkable

from nerfnav.field import Field
from nerfnav.planner import terms
from nerfnav.planner.moving.movers import Movers
from nerfnav.planner.objective.problem import PlanProblem
from nerfnav.planner.risk.costs import CostWeights
from nerfnav.planner.space.occupancy import OccupancyConfig, OccupancyMap
from nerfnav.planner.steps import PlanSteps
from nerfnav.planner.terms.term import CostTerm
from nerfnav.planner.trajectory import Route
from nerfnav.robots import PAPER_NOISE, Motion, NoiseModel, Robot

_ROOM, _CARE = 0.04, 3.0
"""Room around the body [m] and factor on the weight of collision when a plan is redone in flight."""
RISK = 100.0
"""Default cost in flight of a collision due to noise [J]: as much as 100 s of hovering. Of flights
between the ends of the church's tasks with the state known, 5.0 % touched something with 30, 4.7 % with 60, 1,000
flights each, and 3.8 % of 2,000 with 100, which takes 4 % longer; with a covariance that grows (tracking_error.py)
3.1 % do, and as many of 1,400 with 200."""


@runtime_checkable
class Planner(Protocol):
    """Planner of a path that it can plan again in flight."""

    def plan(self, route: Route) -> PlanSteps:
        """Plan a route from scratch."""
        ...

    def replan(self, last: Motion, route: Route, executed: int) -> PlanSteps:
        """Plan again with the rest of `last`, of which `executed` steps are done, as warm start.

        The route's start is an estimate: a state that the robot cannot have, such as a cart in the air, counts as the
        nearest one that it can.
        """
        ...


@runtime_checkable
class InteractivePlanner(Planner, Protocol):
    """Planner that is quick enough to plan again while the user drags an end."""

    def replan_moved_ends(self, last: Motion, route: Route) -> PlanSteps:
        """Plan with `last`, a plan between ends that were near, as warm start."""
        ...


@runtime_checkable
class PlannerConfig(Protocol):
    """Settings of a planner: a frozen dataclass."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def weights(self) -> CostWeights:
        """Return the weights of the terms of J."""
        ...

    @property
    def occupancy(self) -> OccupancyConfig:
        """Return the settings of the occupancy map for A*."""
        ...

    @property
    def iterations(self) -> int:
        """Return the largest number of iterations."""
        ...


Config = TypeVar("Config", bound=PlannerConfig)


@dataclass(frozen=True)
class FieldPlanner:
    """Common base of this project's planners: one robot in one field."""

    field: Field
    """Field to plan in."""
    robot: Robot
    """Robot to plan for."""
    terms: tuple[CostTerm, ...] = dataclasses.field(default_factory=terms.list_terms, kw_only=True)
    """Terms of J, see PlanProblem."""
    noise: NoiseModel = dataclasses.field(default=PAPER_NOISE, kw_only=True)
    """Noise of the flight, for plans that count risk."""
    occupancy: OccupancyMap | None = dataclasses.field(default=None, kw_only=True)
    """Saves making the map of the field again where the caller has it."""
    risk_dt: float | None = dataclasses.field(default=None, kw_only=True)
    """See PlanProblem; for plans whose steps change with each move of a hand."""
    movers: Movers | None = dataclasses.field(default=None, kw_only=True)
    """Announced obstacles that move; None: all stands."""
    avoids_movers: ClassVar[bool] = False
    """True if its plans let movers pass, or go around them."""
    keeps_headings: ClassVar[bool] = False
    """True if it follows `Route.keeps_headings`: a first plan may then choose headings for what the camera sees."""

    def problem(self, route: Route) -> PlanProblem:
        """Return the problem of planning from scratch."""
        return PlanProblem(
            self.field, self.robot, route.start, route.goal, route.steps, route.dt, self.terms, self.noise,
            keeps_headings=route.keeps_headings, risk_dt=self.risk_dt, movers=self.movers, time=route.time,
        )  # fmt: skip

    def rest(self, last: Motion, route: Route) -> PlanProblem:
        """Return the problem of planning the rest of `last` from an estimate, or from the nearest state that the robot
        can have."""
        return self.problem(replace(route, start=self.robot.settled(route.start, last.states[0])))


def with_room(config: Config) -> Config:
    """Add room around the body and weight on collision, for a robot in flight, which noise will push.

    4 cm of room are twice the 2 cm by which a step is disturbed (paper: none), and collision weighs three times as
    much. With the state known to millimetres, 9 of 160 flights of the paper's planner through Stonehenge then touched
    something; 21 with 3 cm and no more weight.
    """
    weights = config.weights
    return replace(
        config, weights=replace(weights, margin=max(_ROOM, weights.margin), collision=_CARE * weights.collision)
    )


def with_risk(config: Config) -> Config:
    """Count the risk of the noise to come in J, for a robot in flight.

    It takes the place of the room in `with_room`: that is as wide in a strait, where there is none, as in the open.
    """
    return replace(config, weights=replace(config.weights, risk=config.weights.risk or RISK))


@dataclass(frozen=True)
class PlannerEntry:
    """Planner that users choose by name."""

    name: str
    """Name, as in `--planner`."""
    make: Callable[..., Planner]
    """Constructor: (field, robot, first=config, again=config, occupancy=map)."""
    config: Callable[[], PlannerConfig]
    """Constructor of the default settings of its first plan."""
    again: Callable[[Any], PlannerConfig] = with_room
    """Convert the settings of a first plan to those with which the plan is redone at each step of a flight."""
    real_time: bool = False
    """True if it is quick enough to plan again while the user drags an end."""
    color: tuple[int, int, int] = (148, 163, 184)
    """Colour of its line where planners are compared, sRGB."""

    @property
    def avoids_movers(self) -> bool:
        """Check whether its plans let movers pass, or go around them."""
        return getattr(self.make, "avoids_movers", False)

    def in_flight(self, settings: PlannerConfig, risk: float | None = None) -> PlannerConfig:
        """Return the settings with which plans are redone in flight; `risk` [J] replaces the planner's own.

        Without risk, 0, they keep room around the body instead.
        """
        again = self.again(settings)
        if risk is None or not again.weights.risk:
            return again
        return with_room(settings) if risk == 0 else replace(again, weights=replace(again.weights, risk=risk))

    def first_in_flight(self, settings: PlannerConfig, again: PlannerConfig | None = None) -> PlannerConfig:
        """Return the settings of a flight's first plan: `settings`, with the weight of risk that later plans have.

        Those are planned with `again`; None: with the planner's own.
        """
        risk = (again or self.again(settings)).weights.risk
        return replace(settings, weights=replace(settings.weights, risk=risk))

    def planner(
        self,
        field: Field,
        robot: Robot,
        first: PlannerConfig | None = None,
        again: PlannerConfig | None = None,
        occupancy: OccupancyMap | None = None,
    ) -> Planner:
        """Make this planner for one robot in one field; `occupancy` saves making the map again where the caller has it.
        """
        first = self.config() if first is None else first
        return self.make(field, robot, first=first, again=again or self.again(first), occupancy=occupancy)
