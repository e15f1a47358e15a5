"""Planner protocol: the interface of every planner, their common base, and the entry of the registry."""

import dataclasses
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Protocol, TypeVar, runtime_checkable

from nerfnav.field import Field
from nerfnav.planner import terms
from nerfnav.planner.objective.problem import PlanProblem
from nerfnav.planner.risk.costs import CostWeights
from nerfnav.planner.risk.tracking_error import PAPER_NOISE, NoiseModel
from nerfnav.planner.space.occupancy import OccupancyConfig, OccupancyMap
from nerfnav.planner.steps import PlanStep
from nerfnav.planner.terms.term import CostTerm
from nerfnav.planner.trajectory import Route
from nerfnav.robots import Motion, Robot

_ROOM, _CARE = 0.04, 3.0
"""Room around the body [m], and how many times as much collision weighs, when a plan is redone in flight."""


RISK = 100.0
"""What a collision that noise brings about costs by default in flight [J]: as much as 100 s of hovering. Of flights
between the ends of the church's tasks with the state known, 5.0 % touched something with 30, 4.7 % with 60, 1,000
flights each, and 3.8 % of 2,000 with 100, which takes 4 % longer; with a spread that grows (tracking_error.py) 3.1 %
do, and as many of 1,400 with 200."""


@runtime_checkable
class Planner(Protocol):
    """Anything that finds a way and then keeps finding the rest of it."""

    def plan(self, route: Route) -> Iterator[PlanStep]:
        """Plan from scratch; the last step has the outcome."""
        ...

    def replan(self, last: Motion, route: Route, executed: int) -> Iterator[PlanStep]:
        """Plan the rest of `last`, of which `executed` steps are done, as hot start.

        The route's start is an estimate: what the robot cannot be in, such as a cart in the air, is read as the
        nearest it can.
        """
        ...


@runtime_checkable
class InteractivePlanner(Planner, Protocol):
    """A planner that is quick enough to plan again while a hand still holds an end."""

    def follow(self, last: Motion, route: Route) -> Iterator[PlanStep]:
        """Plan with `last`, a plan between ends that were near, as warm start; the last step has the outcome."""
        ...


@runtime_checkable
class PlannerConfig(Protocol):
    """A frozen dataclass that says how a planner plans."""

    __dataclass_fields__: ClassVar[dict[str, Any]]

    @property
    def weights(self) -> CostWeights:
        """What the terms of J weigh."""
        ...

    @property
    def occupancy(self) -> OccupancyConfig:
        """How the field becomes a map for A*."""
        ...

    @property
    def iterations(self) -> int:
        """Most iterations that planning may take."""
        ...


Config = TypeVar("Config", bound=PlannerConfig)


@dataclass(frozen=True)
class FieldPlanner:
    """What all planners of this project have in common: one robot in one field."""

    field: Field
    """Where."""
    robot: Robot
    """Who."""
    terms: tuple[CostTerm, ...] = dataclasses.field(default_factory=terms.counted, kw_only=True)
    """What J is the sum of, see PlanProblem."""
    disturbance: NoiseModel = dataclasses.field(default=PAPER_NOISE, kw_only=True)
    """What will disturb the robot, for plans that count risk."""

    def problem(self, route: Route) -> PlanProblem:
        """What there is to plan from scratch."""
        return PlanProblem(
            self.field, self.robot, route.start, route.goal, route.steps, route.dt, self.terms, self.disturbance,
            keeps_headings=route.keeps_headings,
        )  # fmt: skip

    def rest(self, last: Motion, route: Route) -> PlanProblem:
        """What is left to plan of `last` from an estimate, or from the nearest state that the robot can be in."""
        return self.problem(replace(route, start=self.robot.settled(route.start, last.states[0])))


def with_room(config: Config) -> Config:
    """The same for a robot in flight, which will be pushed: with room around its body, and more weight on collision.

    4 cm of room are twice the 2 cm by which a step is disturbed (paper: none), and collision weighs three times as
    much. With the state known to millimetres, 9 of 160 flights of the paper's planner through Stonehenge then touched
    something; 21 with 3 cm and no more weight.
    """
    weights = config.weights
    return replace(
        config, weights=replace(weights, margin=max(_ROOM, weights.margin), collision=_CARE * weights.collision)
    )


def with_risk(config: Config) -> Config:
    """The same for a robot in flight, which will be pushed: what the noise to come may do counts in J.

    It takes the place of the room in `with_room`: that is as wide in a strait, where there is none, as in the open.
    """
    return replace(config, weights=replace(config.weights, risk=config.weights.risk or RISK))


@dataclass(frozen=True)
class PlannerEntry:
    """A planner, as users choose it by name."""

    name: str
    """What they call it, as in `--planner`."""
    make: Callable[..., Planner]
    """Makes it: (field, robot, first=config, again=config, occupancy=map)."""
    config: Callable[[], PlannerConfig]
    """Makes the settings of its first plan where nobody gives others."""
    again: Callable[[Any], PlannerConfig] = with_room
    """Settings of a first plan to those with which the plan is redone at each step of a flight."""
    real_time: bool = False
    """Whether it is quick enough to plan again while a hand still holds an end."""
    color: tuple[int, int, int] = (148, 163, 184)
    """Of its line where planners are compared, sRGB."""

    def in_flight(self, settings: PlannerConfig, risk: float | None = None) -> PlannerConfig:
        """The settings with which plans are redone in flight; `risk` [J] in place of the planner's own.

        Without risk, 0, they keep room around the body instead.
        """
        again = self.again(settings)
        if risk is None or not again.weights.risk:
            return again
        return with_room(settings) if risk == 0 else replace(again, weights=replace(again.weights, risk=risk))

    def planner(
        self,
        field: Field,
        robot: Robot,
        first: PlannerConfig | None = None,
        again: PlannerConfig | None = None,
        occupancy: OccupancyMap | None = None,
    ) -> Planner:
        """This planner for one robot in one field; `occupancy` saves making the map again where the caller has it."""
        first = self.config() if first is None else first
        return self.make(field, robot, first=first, again=again or self.again(first), occupancy=occupancy)
