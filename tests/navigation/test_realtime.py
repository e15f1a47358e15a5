"""A world that does not wait."""

from dataclasses import replace

import pytest
import torch

from nerfnav.estimator import ConsiderCovariance
from nerfnav.navigation.episode import Episode, EpisodeOutcome, NavigationStep
from nerfnav.navigation.flight import NavigateConfig, NavigationStack
from nerfnav.navigation.loop import navigate
from nerfnav.navigation.realtime import advance_plan, count_missed
from tests.navigation.doubles import CALM, REQUEST, ROBOT, Oracle, StraightPlanner, draws, simulator


class SlowClock:
    """Each look at it is a quarter of a second after the one before it at the given looks, else no time passes."""

    def __init__(self, slow: set[int]) -> None:
        self.now, self.looks, self.slow = 0.0, 0, slow

    def __call__(self) -> float:
        self.looks += 1
        self.now += 0.25 if self.looks in self.slow else 0.0
        return self.now


_TAKE_OFF = 12
"""Looks at the clock before the first step: two planners of two iterations."""


def flown(slow: set[int], realtime: bool = True, map_error: ConsiderCovariance | None = None) -> list[NavigationStep]:
    world = simulator()
    stack = NavigationStack(StraightPlanner(), Oracle(world), map_error=map_error or ConsiderCovariance())
    request = replace(REQUEST, realtime=realtime, clock=SlowClock({_TAKE_OFF + look for look in slow}))
    events = navigate(request, world, stack, NavigateConfig(noise=CALM), draws(1))
    return [event for event in events if isinstance(event, NavigationStep)]


def test_time_steps_are_missed_only_by_what_takes_longer_than_one() -> None:
    assert [count_missed(ms, 0.1) for ms in (0, 99, 100, 101, 200, 250)] == [0, 0, 0, 1, 1, 2]


def test_a_world_that_waits_and_one_that_does_not_are_the_same_while_nothing_is_late() -> None:
    waits, goes_on = flown(set(), realtime=False), flown(set())
    assert len(waits) == len(goes_on) and not any(step.late for step in goes_on)
    assert torch.equal(waits[-1].truth.position, goes_on[-1].truth.position)


def test_late_steps_include_the_map_error_as_well() -> None:
    map_error = ConsiderCovariance(tuple((0.05**2 * torch.eye(6)).flatten().tolist()))
    plain, wrong = flown({8}), flown({8}, map_error=map_error)
    assert any(step.late for step in wrong)
    for before, step in zip(plain[1:], wrong[1:], strict=True):
        assert torch.equal(step.truth.position, before.truth.position)
        more = step.belief.covariance - before.belief.covariance
        torch.testing.assert_close(more, map_error.at(step.belief), rtol=0, atol=1e-8)


def test_a_late_step_lets_the_robot_fly_by_its_older_plan_meanwhile() -> None:
    steps = flown({8})
    late = [step for step in steps if step.late]
    assert [step.index for step in late] == [late[0].index, late[0].index + 1], "0.25 s are two more steps"
    slow, before = steps[late[0].index - 1], steps[late[0].index - 2]
    assert slow.filter_ms + slow.replan_ms == pytest.approx(250)
    for ahead, step in enumerate(late, 1):
        assert step.action is not None and torch.equal(step.action, before.plan.actions[ahead])
        assert step.image is None and step.filter_ms == 0
    assert torch.equal(late[-1].plan.actions, slow.plan.actions[2:])
    assert [step.index for step in steps] == list(range(len(steps)))


def test_late_steps_are_counted_and_the_flight_arrives_all_the_same() -> None:
    steps = flown({8, 20})
    episode = Episode.of(steps)
    assert steps[-1].outcome is EpisodeOutcome.REACHED
    assert episode.metrics()["late_steps"] == len(episode.late) == 4
    assert episode.metrics()["timing_ms"]["step_p95"] > 0
    assert [step.index for step in flown({8, 20})] == [step.index for step in steps]


def test_a_robot_whose_plan_has_run_out_comes_to_rest() -> None:
    plan = flown(set())[3].plan
    rest = advance_plan(plan, len(plan.actions), plan.states[2], ROBOT)
    assert rest.states.velocity[-1].norm() < plan.states.velocity[2].norm()
    assert len(advance_plan(plan, 2, plan.states[2], ROBOT).actions) == len(plan.actions) - 2
