"""Episodes: stacking, numbers, storage."""

import json
from dataclasses import fields, replace
from pathlib import Path

import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.navigation.episode import Episode, EpisodeOutcome, NavigationStep, is_silent
from nerfnav.navigation.flight import NavigateConfig, NavigationStack, OperatorRequests
from nerfnav.navigation.loop import navigate
from nerfnav.navigation.supervisor import SupervisorAction
from nerfnav.robots.state import RigidState
from tests.navigation.doubles import CALM, REQUEST, Oracle, StraightPlanner, draws, simulator


@pytest.fixture(scope="module")
def flight() -> list[NavigationStep]:
    world = simulator(contact=lambda before, after: bool(before.position[0] < 0 <= after.position[0]))
    config = NavigateConfig(initial=CALM, fly_on=True)
    events = navigate(REQUEST, world, NavigationStack(StraightPlanner(), Oracle(world)), config, draws(1))
    return [event for event in events if isinstance(event, NavigationStep)]


def shifted(steps: list[NavigationStep], tangent: torch.Tensor, variance: float) -> list[NavigationStep]:
    """The same flight with beliefs that are off by a given tangent."""
    covariance = variance * torch.eye(12)
    return [
        replace(step, belief=replace(step.belief, mean=step.truth.retract(-tangent), covariance=covariance))
        for step in steps
    ]


def test_an_episode_stacks_a_flight_over_time(flight: list[NavigationStep]):
    episode = Episode.of(flight)
    count = len(flight)
    assert episode.truth.position.shape == (count, 3)
    assert episode.beliefs.covariance.shape == (count, 12, 12)
    assert episode.actions.shape == (count - 1, 4)
    assert len(episode.plans) == count
    assert episode.times[-1] == pytest.approx(0.1 * (count - 1))
    assert episode.outcome is EpisodeOutcome.COLLIDED
    torch.testing.assert_close(episode.goal.position, REQUEST.goal.position)


def test_the_last_goal_of_a_flight_is_what_it_missed() -> None:
    world, there = simulator(), RigidState.at_rest((-0.3, 0.6, 0.4))
    request = replace(REQUEST, operator=lambda: OperatorRequests(goal=there))
    stack, config = NavigationStack(StraightPlanner(), Oracle(world)), NavigateConfig(initial=CALM, noise=CALM)
    steps = [step for step in navigate(request, world, stack, config, draws(1)) if isinstance(step, NavigationStep)]
    episode = Episode.of(steps)
    assert episode.outcome is EpisodeOutcome.REACHED
    torch.testing.assert_close(episode.goal.position, there.position)
    missed = (world.state.position - there.position).norm().item()
    assert episode.metrics()["final_position_error_m"] == pytest.approx(missed, rel=1e-4) and missed < 0.1


def test_a_robot_that_holds_in_the_end_was_to_arrive_where_it_was_going_before(flight: list[NavigationStep]) -> None:
    last = flight[-1]
    rest = replace(last.plan, states=last.plan.states.map(lambda part: part.flip(0)))
    nowhere = replace(last.plan, states=last.plan.states.map(lambda part: part * torch.nan))
    for end in (replace(last, plan=rest, recovery=SupervisorAction.WIDENED), replace(last, plan=nowhere)):
        torch.testing.assert_close(Episode.of([*flight[:-1], end]).goal.position, REQUEST.goal.position)


def test_a_flight_that_was_stopped_has_that_outcome(flight: list[NavigationStep]):
    assert Episode.of(flight[:3]).outcome is EpisodeOutcome.STOPPED


def test_an_episode_of_nothing_is_refused():
    with pytest.raises(InvalidInputError, match="at least one"):
        Episode.of([])


def test_the_errors_are_root_mean_squares_of_what_the_beliefs_are_off(flight: list[NavigationStep]):
    tangent = torch.zeros(12)
    tangent[:3] = torch.tensor([0.03, 0.0, 0.04])
    tangent[3], tangent[6] = 0.2, 0.1
    numbers = Episode.of(shifted(flight, tangent, 0.01)).metrics()["estimation"]
    assert numbers["position_rmse_m"] == pytest.approx(0.05, rel=1e-4)
    assert numbers["velocity_rmse"] == pytest.approx(0.2, rel=1e-4)
    assert numbers["rotation_rmse_rad"] == pytest.approx(0.1, rel=1e-4)
    assert numbers["nees_mean"] == pytest.approx((0.05**2 + 0.2**2 + 0.1**2) / 0.01, rel=1e-3)


def test_the_start_before_any_picture_does_not_count(flight: list[NavigationStep]):
    far = replace(flight[0].belief, mean=RigidState.at_rest((9.0, 9.0, 9.0)))
    steps = [replace(flight[0], belief=far), *shifted(flight[1:], torch.zeros(12), 0.01)]
    assert Episode.of(steps).metrics()["estimation"]["position_rmse_m"] == pytest.approx(0.0, abs=1e-6)


def test_the_numbers_of_a_flight_are_those_that_fly_promises(flight: list[NavigationStep]):
    steps = [replace(step, filter_ms=2.0, replan_ms=float(step.index)) for step in flight]
    numbers = Episode.of(steps).metrics()
    assert numbers["outcome"] == "collided"
    assert numbers["steps"] == len(flight) - 1
    assert numbers["mesh_collision_steps"] == 1
    assert numbers["final_position_error_m"] < 0.1
    timing = numbers["timing_ms"]
    assert timing["filter_p50"] == timing["filter_p95"] == 2.0
    assert timing["replan_p50"] == pytest.approx(len(flight) / 2)
    assert timing["step_p50"] == pytest.approx(len(flight) / 2 + 2)
    json.dumps(numbers, allow_nan=False)


def test_a_flight_of_no_steps_has_no_errors(flight: list[NavigationStep]):
    numbers = Episode.of(flight[:1]).metrics()
    assert numbers["steps"] == 0
    assert set(numbers["estimation"].values()) == {None}
    assert set(numbers["timing_ms"].values()) == {None}


def test_an_episode_comes_back_as_it_was_saved(flight: list[NavigationStep], tmp_path: Path):
    episode = Episode.of(flight)
    files = episode.save(tmp_path / "runs" / "first")
    again = Episode.load(tmp_path / "runs" / "first")
    assert sorted(path.name for path in files) == sorted(path.name for path in files[0].parent.iterdir())
    for part in fields(RigidState):
        assert torch.equal(getattr(again.truth, part.name), getattr(episode.truth, part.name))
        assert torch.equal(getattr(again.beliefs.mean, part.name), getattr(episode.beliefs.mean, part.name))
    assert torch.equal(again.beliefs.covariance, episode.beliefs.covariance)
    assert torch.equal(again.actions, episode.actions) and torch.equal(again.touched, episode.touched)
    assert again.outcome is episode.outcome and again.dt == episode.dt
    for plan, other in zip(again.plans, episode.plans, strict=True):
        assert torch.equal(plan.states.position, other.states.position)
        assert torch.equal(plan.actions, other.actions)
    assert again.metrics() == episode.metrics()


def test_saving_again_replaces_the_earlier_episode(flight: list[NavigationStep], tmp_path: Path):
    Episode.of(flight).save(tmp_path)
    Episode.of(flight[:2]).save(tmp_path)
    assert len(Episode.load(tmp_path).plans) == 2


def test_a_folder_without_an_episode_is_refused(tmp_path: Path):
    with pytest.raises(InvalidInputError, match=r"episode\.json is missing"):
        Episode.load(tmp_path)


@pytest.mark.parametrize("name", ["episode.json", "episode.npz"])
def test_a_truncated_episode_is_refused(flight: list[NavigationStep], tmp_path: Path, name: str):
    Episode.of(flight).save(tmp_path)
    whole = (tmp_path / name).read_bytes()
    (tmp_path / name).write_bytes(whole[: len(whole) // 2])
    with pytest.raises(InvalidInputError, match="no readable nerfnav episode"):
        Episode.load(tmp_path)


def test_another_version_is_refused(flight: list[NavigationStep], tmp_path: Path):
    Episode.of(flight).save(tmp_path)
    text = (tmp_path / "episode.json").read_text().replace('"version": 1', '"version": 9')
    (tmp_path / "episode.json").write_text(text)
    with pytest.raises(InvalidInputError, match="version 9"):
        Episode.load(tmp_path)


def test_a_divergence_is_silent_when_for_three_steps_nothing_says_it() -> None:
    far, outside, tracking = [0.06] * 3, [False] * 3, [True] * 3
    assert is_silent(far, outside, tracking)
    assert not is_silent([0.06, 0.04, 0.06, 0.06], [False] * 4, [True] * 4), "three in a row"
    assert not is_silent(far, [False, True, False], tracking), "the covariance says so"
    assert not is_silent(far, outside, [True, True, False]), "the supervisor says so"


def test_a_flight_whose_beliefs_are_off_and_sure_is_silent(flight: list[NavigationStep]) -> None:
    tangent = torch.zeros(12)
    tangent[0] = 0.06
    assert Episode.of(shifted(flight, tangent, 0.01**2)).metrics()["silent"] is True
    assert Episode.of(shifted(flight, tangent, 0.1**2)).metrics()["silent"] is False
    held = [replace(step, recovery=SupervisorAction.WIDENED) for step in shifted(flight, tangent, 0.01**2)]
    assert Episode.of(held).metrics()["silent"] is False
