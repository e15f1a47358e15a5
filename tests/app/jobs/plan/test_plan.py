"""Planning as a job: its events, its end, its cancellation."""

from pathlib import Path

import pytest

from nerfnav.core.errors import InvalidInputError, OccupiedError, UnknownNameError
from nerfnav.planner.solvers.adam import PlanConfig
from nerfnav.planner.steps import PlanStep
from nerfnav_app.jobs.events import Progress
from nerfnav_app.jobs.plan.plan import PlanRequest, run
from nerfnav_app.places.ends import End, Ends
from nerfnav_app.places.place import Place, open_place
from tests.app.following import followed, result_of

QUICK = PlanConfig(iterations=7)


@pytest.fixture(scope="module")
def place(field_file: Path) -> Place:
    return open_place(str(field_file))


def request(**changes: object) -> PlanRequest:
    goal = changes.pop("goal", (0.6, 0.0, 0.5))
    ends = Ends(End((-0.6, 0.0, 0.5)), End(goal))  # type: ignore[arg-type]
    return PlanRequest(ends, **{"planner": "paper", "config": QUICK} | changes)


def test_every_iteration_is_told_and_the_result_has_the_numbers(place: Place) -> None:
    events, finished = followed(run(request(), place))
    steps = [event for event in events if isinstance(event, PlanStep)]
    assert [step.iteration for step in steps] == list(range(7))
    assert finished.summary["cost"]["total"] == steps[-1].cost.total
    assert finished.files == ()


def test_progress_only_grows(place: Place) -> None:
    fractions = [event.fraction for event in run(request(), place) if isinstance(event, Progress)]
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1


def test_a_hand_may_begin_between_the_maps_that_a_plan_searches_on(place: Place) -> None:
    events = list(run(request(planner="fast", config=None), place))
    first = next(index for index, event in enumerate(events) if isinstance(event, PlanStep))
    begun = [event for event in events[:first] if isinstance(event, Progress)]
    assert len(begun) >= 5, "at the start, and after occupancy, noise, chances of collisions and their cost"
    drafted = list(run(request(planner="fast", config=None, draft=True), place))
    assert not isinstance(drafted[0], PlanStep) and isinstance(drafted[1], PlanStep), "a draft makes none of them"


def test_a_cancelled_plan_writes_nothing(place: Place, tmp_path: Path) -> None:
    job = run(request(out=tmp_path), place)
    next(job)
    next(job)
    job.close()
    assert list(tmp_path.iterdir()) == []


def test_the_three_files_are_named_in_the_end(place: Place, tmp_path: Path) -> None:
    finished = result_of(run(request(out=tmp_path / "run"), place))
    assert {path.name for path in finished.files} == {"trajectory.csv", "trajectory.json", "plan.json"}
    assert {path.name for path in (tmp_path / "run").iterdir()} == {path.name for path in finished.files}


def test_a_goal_in_the_column_is_refused_with_a_free_point(place: Place) -> None:
    with pytest.raises(OccupiedError, match="nearest free point") as refusal:
        list(run(request(goal=(0.0, 0.0, 0.5)), place))
    assert refusal.value.nearest is not None
    list(run(request(goal=refusal.value.nearest), place))


def test_a_name_that_is_no_planner_is_refused(place: Place) -> None:
    with pytest.raises(UnknownNameError, match="known are: fast, minsnap, paper"):
        request(planner="luck")


def test_the_fast_planner_plans_with_settings_of_its_own(place: Place) -> None:
    steps, finished = followed(run(request(planner="fast", config=None), place))
    assert finished.summary["outcome"] == "converged"
    totals = [step.cost.total for step in steps if isinstance(step, PlanStep)]
    assert finished.summary["cost"]["total"] == totals[-1] < totals[0]


def test_settings_of_another_planner_are_refused(place: Place) -> None:
    with pytest.raises(InvalidInputError, match="not those of the planner 'fast'"):
        request(planner="fast")


@pytest.mark.parametrize("wrong", [0.0, -0.1, 2.0, float("nan")])
def test_what_is_no_probability_is_refused(wrong: float) -> None:
    with pytest.raises(InvalidInputError, match="max_collision must be a probability, above 0 and at most 1"):
        request(max_collision=wrong)


@pytest.mark.parametrize("wrong", [{"dt": 0.0}, {"dt": float("nan")}, {"steps": 0}, {"config": PlanConfig(0)}])
def test_numbers_that_make_no_plan_are_refused(wrong: dict[str, object]) -> None:
    with pytest.raises(InvalidInputError, match="must be a number above 0"):
        request(**wrong)
