"""Replanning: both loops fly the same plan in the same noise, and the truth judges them."""

from dataclasses import replace
from functools import cache
from itertools import pairwise

import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.steps import run_steps
from nerfnav.experiments import closed_loop_flight
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.closed_loop import REFUSED
from nerfnav.experiments.closed_loop_flight import FlightTrial, make_problem
from nerfnav.experiments.flight_options import FlightOptions
from nerfnav.experiments.replanning import (
    LOOPS,
    cost_per_step,
    costs_so_far,
    draw_figure,
    executed,
    fly,
    fly_both,
    record,
    run,
    summarize,
)
from nerfnav.experiments.study import Study
from nerfnav.navigation import NavigationStep
from nerfnav.planner import CostWeights, PlanProblem, terms
from nerfnav.planner.terms.term import evaluate
from nerfnav.robots import Quadrotor
from nerfnav.world import Task
from tests.experiments.places import TASKS, column

INSIDE = Task("Into the column", (-0.7, 0.0, 0.5), (0.0, 0.0, 0.5))


def noise_of(flown: list[NavigationStep]) -> torch.Tensor:
    """Errors (n, 12) of the true states against the dynamics."""
    errors = []
    for before, after in pairwise(flown):
        assert after.action is not None
        errors.append(Quadrotor().step(before.truth, after.action, 0.1).local(after.truth))
    return torch.stack(errors)


@pytest.mark.slow
def test_both_loops_fly_the_same_plan_in_the_same_noise() -> None:
    trial = FlightTrial(TASKS[1], 3, known=True, fly_on=True)
    problem = make_problem(column(), TASKS[1], trial)
    flown = fly_both(column(), problem, trial)
    plans = [flown[loop][0].first_plan for loop in LOOPS]
    assert plans[0] is not None and plans[1] is not None and torch.equal(plans[0].actions, plans[1].actions)
    closed, blind = (noise_of(flown[loop]) for loop in LOOPS)
    steps = min(len(closed), len(blind))
    assert steps >= 15 and torch.allclose(closed[:steps], blind[:steps], atol=1e-4)
    assert torch.equal(executed(flown["open"]).actions, plans[0].actions), "no plan but the first is flown"
    assert (flown["open"][-1].belief.mean.position - problem.goal.position).norm() < 0.01, "it believes to have arrived"


@pytest.mark.slow
def test_a_replay_is_the_flight_of_the_table() -> None:
    trial = FlightTrial(TASKS[1], 3, known=True, fly_on=True)
    flown = fly_both(column(), make_problem(column(), TASKS[1], trial), trial)
    for loop in LOOPS:
        recording = record(column(), trial, loop)
        assert recording is not None and recording.title == "column, Along the wall"
        assert torch.equal(recording.position, torch.stack([step.truth.position for step in flown[loop]]))


@pytest.mark.slow
def test_only_the_closed_loop_arrives() -> None:
    answers = [fly(column(), FlightTrial(TASKS[1], seed, known=True, fly_on=True)) for seed in (1, 2)]
    found = summarize([row for answer in answers for row in answer["rows"]])
    assert found["closed"]["reached"] == found["closed"]["trials"] == 2 and found["open"]["reached"] == 0
    assert found["closed"]["final_distance_median_m"] <= 0.08 < found["open"]["final_distance_median_m"]
    assert 0.5 < found["closed"]["cost_ratio_median"] < 2, "it ends within the tolerance, perhaps a step early"
    for answer in answers:
        assert {len(answer["costs"][name]) - len(answer["paths"][name]) for name in (*LOOPS, "planned")} == {0}
        assert len(answer["plans"]) == len(answer["paths"]["closed"])
    assert len(draw_figure(column(), answers).axes[0].lines) == 5


def test_the_cost_of_all_steps_is_collision_and_control_of_eq_2() -> None:
    problem = PlanProblem(column().field, Quadrotor(), TASKS[0].start_state, TASKS[0].goal_state)
    through = problem.trajectory_through(torch.tensor([[x, 0.0, 0.5, 0.0] for x in torch.linspace(-0.7, 0.7, 21)]))
    motion = through.motion(problem.robot)
    each = cost_per_step(column(), problem.robot, motion)
    context = problem.context(CostWeights(margin=0.0))
    whole = evaluate([terms.TERMS["collision"], terms.TERMS["control"]], context, motion).numbers()
    assert each.shape == (20,) and whole.collision > 1
    assert each.sum().item() == pytest.approx(whole.total, rel=1e-4)
    assert costs_so_far(column(), problem.robot, motion)[-1] == pytest.approx(whole.total, rel=1e-4)


def test_a_trial_that_cannot_begin_is_refused_in_both_loops() -> None:
    answer = fly(column(), FlightTrial(INSIDE, 0))
    assert [row["outcome"] for row in answer["rows"]] == [REFUSED] * 2
    assert summarize(answer["rows"])["open"]["flown"] == 0
    draw_figure(column(), [answer])


@cache
def annex() -> Arena:
    return replace(column(), scene=replace(column().scene, name="annex"))


def test_a_study_in_several_places_counts_each_and_all_together(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(closed_loop_flight, "navigate", lambda *_: iter(()))  # flights of no steps take no time
    drive = Task("Drive", (-0.7, 0.0, 0.1), (0.7, 0.0, 0.1), robot="diffdrive")
    study = Study(column, (drive, *TASKS), trials=3, flights=FlightOptions("tasks", fly_on=True))
    results = run_steps(run(replace(study, beside=(replace(study, open_arena=annex, trials=1),))))
    assert [(row["place"], row["loop"], row["task"]) for row in results.rows] == [
        (place, loop, TASKS[index % 2].name)
        for place, index in (("column", 0), ("column", 1), ("column", 2), ("annex", 0))
        for loop in LOOPS
    ]
    assert results.summary["left_out"].keys() == {"Drive"}
    counts = {name: found["open"]["trials"] for name, found in results.summary["places"].items()}
    assert counts == {"column": 3, "annex": 1} and results.summary["together"]["open"]["trials"] == 4
    assert results.figures.keys() == {"replanning_column", "replanning_annex"}
    assert results.replays.keys() == {"closed_loop", "open_loop"}
    assert results.replays["open_loop"].record() is None, "a flight of no steps cannot be watched"


def test_flights_with_the_state_known_are_refused() -> None:
    with pytest.raises(InvalidInputError, match="--truth"):
        run_steps(run(Study(column, TASKS, trials=1, flights=FlightOptions("tasks", truth=True))))
