"""The table of planners."""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import pytest

from nerfnav.core.errors import NameTakenError, UnknownNameError
from nerfnav.core.steps import run_steps
from nerfnav.planner import planners
from nerfnav.planner.planners.minsnap import MinSnapPlanner
from nerfnav.planner.planners.planner import RISK, Planner, PlannerConfig, PlannerEntry, with_room
from nerfnav.planner.solvers.adam import PlanConfig
from nerfnav.planner.solvers.fast import FastPlanConfig
from nerfnav.planner.steps import PlanOutcome
from nerfnav.planner.trajectory import Route
from tests.planner.places import ROBOT, across, ball


@dataclass(frozen=True)
class Mine(MinSnapPlanner):
    """A planner of somebody else's."""


@pytest.fixture
def mine() -> Iterator[PlannerEntry]:
    entry = PlannerEntry("mine", Mine, planners.load("minsnap").config)
    planners.register(entry)
    yield entry
    planners.PLANNERS.unregister("mine")


@pytest.mark.parametrize("name", planners.names())
def test_every_planner_is_made_from_its_entry_and_has_settings(name: str) -> None:
    entry = planners.load(name)
    planner = entry.planner(ball(), ROBOT)
    assert isinstance(planner, Planner)
    first = entry.config()
    again = entry.again(first)
    assert isinstance(first, PlannerConfig) and type(again) is type(first)
    assert first.weights.risk == 0
    if again.weights.risk:  # which takes the place of room
        assert name == "fast" and again.weights == replace(first.weights, risk=RISK)
    else:
        assert again.weights.margin == 0.04 and again.weights.collision == 3 * first.weights.collision


def test_a_planner_from_outside_plans_under_its_name(mine: PlannerEntry) -> None:
    assert "mine" in planners.names()
    problem = across(ball(0.15), height=0.5)
    last = run_steps(planners.load("mine").planner(problem.field, ROBOT).plan(problem.route))
    assert last.outcome is PlanOutcome.CONVERGED and len(last.motion.actions) == Route.steps


def test_a_taken_name_is_refused_and_an_unknown_one_lists_the_known(mine: PlannerEntry) -> None:
    planners.register(mine)  # the same again is no other
    with pytest.raises(NameTakenError, match="planner named 'fast' already"):
        planners.register(PlannerEntry("fast", Mine, planners.load("minsnap").config))
    with pytest.raises(UnknownNameError, match="known are: fast, mine, minsnap, paper, rrt"):
        planners.load("slow")


def test_weights_that_a_user_chose_count_in_flight_too() -> None:
    chosen = with_room(FastPlanConfig())
    assert with_room(chosen).weights.collision == 9.0 and with_room(chosen).weights.margin == 0.04


def test_the_papers_planner_replans_with_250_iterations_or_fewer() -> None:
    again = planners.load("paper").again
    assert again(PlanConfig.paper()).iterations == 250 and again(PlanConfig(iterations=5)).iterations == 5
