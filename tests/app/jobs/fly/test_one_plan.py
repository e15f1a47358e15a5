"""The plan that is shown is the plan with which a flight begins."""

from dataclasses import replace
from pathlib import Path

import pytest
import torch

from nerfnav.navigation.episode import NavigationStep
from nerfnav.navigation.flight import NavigateConfig
from nerfnav.planner import PlanResult, PlanStep
from nerfnav.robots import Motion, StateNoise
from nerfnav_app.jobs.fly.fly import run as fly
from nerfnav_app.jobs.fly.request import FlyRequest
from nerfnav_app.jobs.plan.plan import PlanRequest
from nerfnav_app.jobs.plan.plan import run as plan
from nerfnav_app.places.ends import End, Ends
from nerfnav_app.places.place import Place, open_place

ENDS = Ends(End((-0.6, -0.3, 0.5)), End((0.6, -0.2, 0.5)))
PAPER_COST = PlanRequest(ENDS, paper_cost=True)
ROUTES = {
    "task": PlanRequest(ENDS),
    "shortest": PlanRequest(ENDS, shortest=True),
    "paper's cost": PAPER_COST,
    "bounded": PlanRequest(ENDS, max_collision=0.5),
    "physical": PlanRequest(ENDS, world="physical"),
    "rrt": PlanRequest(ENDS, planner="rrt"),
}


@pytest.fixture(scope="module")
def place(field_file: Path) -> Place:
    return open_place(str(field_file))


def planned(route: PlanRequest, place: Place) -> PlanResult:
    return [event for event in plan(route, place) if isinstance(event, PlanResult)][-1]


def taken_off(route: PlanRequest, place: Place, seed: int) -> NavigationStep:
    job = fly(FlyRequest(route, seed=seed), place)
    step = next(event for event in job if isinstance(event, NavigationStep))
    job.close()
    return step


def are_equal(one: Motion, other: Motion | None) -> bool:
    return other is not None and one.dt == other.dt and torch.equal(one.states.position, other.states.position)


@pytest.mark.parametrize("name", ROUTES)
def test_a_flight_begins_with_the_plan_that_is_shown_whatever_its_seed(name: str, place: Place) -> None:
    shown = planned(ROUTES[name], place).motion
    first, other = (taken_off(ROUTES[name], place, seed) for seed in (1, 2))
    assert are_equal(shown, first.first_plan) and are_equal(shown, other.first_plan)
    assert not torch.equal(first.plan.states.position, other.plan.states.position), "beliefs correct it"


def test_the_first_belief_corrects_the_plan_by_about_its_own_error(place: Place) -> None:
    step = taken_off(ROUTES["task"], place, 3)
    assert step.first_plan is not None
    apart = (step.plan.states.position - step.first_plan.states.position).norm(dim=-1)
    assert apart[0] > 0 and apart.max() < 0.05


def test_noise_counts_in_the_plan_and_more_noise_keeps_farther_away(place: Place) -> None:
    calm = replace(ROUTES["task"], flight=NavigateConfig(noise=StateNoise(1e-4, 1e-4, 1e-4, 1e-4)))
    by_noise = [planned(route, place).cost.risk for route in (PAPER_COST, calm, ROUTES["task"])]
    assert by_noise[0] == 0 and by_noise[1] < by_noise[2]


def test_the_headings_that_are_chosen_leave_the_duration_as_it_is(place: Place) -> None:
    route = ROUTES["task"]
    blind = replace(route, flight=NavigateConfig(in_sight=0.0))
    steps = [len(planned(each, place).motion.actions) for each in (route, blind)]
    assert steps == [route.steps, route.steps]


def test_a_flight_shows_the_iterations_of_its_first_plan(place: Place) -> None:
    events = []
    for event in fly(FlyRequest(ROUTES["task"]), place):
        events.append(event)
        if isinstance(event, NavigationStep):
            break
    assert sum(isinstance(event, PlanStep) for event in events) > 5


@pytest.mark.slow
def test_a_plan_that_is_made_safer_keeps_the_heading_that_was_chosen() -> None:
    playground = open_place("playground")
    task = next(task for task in playground.tasks if task.name == "Through the tube")
    routes = [PlanRequest(Ends.of_task(task), max_collision=most) for most in (None, 1e-6)]
    first, safer = (planned(route, playground).motion.states for route in routes)
    asked = task.goal_state.rotation
    assert not torch.allclose(first.rotation[-1], asked, atol=0.1), "a heading is chosen here"
    torch.testing.assert_close(safer.rotation[-1], first.rotation[-1])
