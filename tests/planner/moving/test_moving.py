"""Plans among moving obstacles: limits, obstacles kept clear of, slower and waiting plans, replanning."""

import itertools
from dataclasses import replace

import numpy as np
import pytest

from nerfnav.core.errors import InvalidInputError
from nerfnav.obstacles import BoxShape, ConstantVelocity, Obstacle, ObstacleSet, RandomWalk, WayPoints
from nerfnav.planner.moving.problem import MotionLimits, MovingConfig, MovingProblem, Steps, axes_towards
from nerfnav.planner.moving.replanning import Replanner
from nerfnav.planner.moving.search import plan_among
from nerfnav.planner.moving.spline import SplinePlan, progress

HALF = (0.1, 0.1, 0.1)


def box(name: str, x: float, y: float, z: float, *edges: float) -> Obstacle:
    a, b, c = edges or (0.8, 0.8, 0.8)
    return Obstacle(name, BoxShape((a, b, c)), (x, y, z))


def walkers(seed: int, count: int = 12) -> ObstacleSet:
    """Boxes that wander at up to 1.2 m/s between start and goal."""
    random = np.random.default_rng(seed)
    drawn = zip(random.uniform(4, 26, count), random.uniform(0.3, 1.2, count), strict=True)
    return ObstacleSet(tuple(
        Obstacle(
            f"walker {index}", BoxShape((0.8, 0.8, 0.8)), (float(x), 0.0, 1.5),
            motion=RandomWalk((-2.0, -3.0, -1.0), (2.0, 3.0, 1.0), float(speed), index + 100 * seed),
        )
        for index, (x, speed) in enumerate(drawn)
    ))  # fmt: skip


def problem(obstacles: ObstacleSet, **changes: object) -> MovingProblem:
    given = MovingProblem(obstacles, (0.0, 0.0, 1.5), (30.0, 0.3, 1.7), HALF, (-1.0, -3.0, 0.5), (31.0, 3.0, 3.0))
    return replace(given, **changes)


def gap(plan: SplinePlan, obstacles: ObstacleSet, half: float = 0.1) -> float:
    """Least distance of the robot's box from the boxes, in the world, at 200 Hz [m]."""
    times = np.arange(0, plan.duration, 0.005)
    boxes = obstacles.boxes(times)
    off = np.abs(plan.derivative(times)[:, None] - boxes.centers) - boxes.halves - half
    return float(np.linalg.norm(off.clip(0), axis=-1).min())


def worst(plan: SplinePlan, order: int) -> np.ndarray:
    return np.abs(plan.derivative(np.arange(0, plan.duration, 0.003), order)).max(0)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("limits", [MotionLimits(), MotionLimits(2.0, 3.0, 20.0), MotionLimits(8.0, 30.0, 60.0)])
def test_a_plan_keeps_clear_of_what_moves_and_within_the_limits(seed: int, limits: MotionLimits) -> None:
    obstacles = walkers(seed)
    plan = plan_among(problem(obstacles, limits=limits))
    assert plan is not None and gap(plan, obstacles) > 0
    ends = plan.derivative(np.array([0.0, plan.duration]))
    np.testing.assert_allclose(ends, [[0, 0, 1.5], [30, 0.3, 1.7]], atol=1e-9)
    for order, most in ((1, limits.speed), (2, limits.acceleration), (3, limits.jerk)):
        assert (worst(plan, order) <= most * (1 + 1e-6)).all()
    ends = np.array([0.0, plan.duration, plan.duration + 1.0])
    for order in (1, 2):
        np.testing.assert_allclose(plan.derivative(ends, order), 0, atol=1e-6)
    assert plan.derivative(np.arange(0, plan.duration, 0.003), 2)[:, 2].min() >= -limits.fall * (1 + 1e-6)


def test_derivatives_are_those_of_the_positions() -> None:
    plan = plan_among(problem(walkers(1)))
    assert plan is not None
    times, step = np.linspace(0.5, plan.duration - 0.5, 500) + 1e-3, 1e-6
    for order in range(3):
        slope = (plan.derivative(times + step, order) - plan.derivative(times - step, order)) / (2 * step)
        np.testing.assert_allclose(plan.derivative(times, order + 1), slope, atol=1e-3)


def test_a_plan_in_a_turned_frame_is_the_same_plan_in_the_world() -> None:
    start, goal = (1.0, 2.0, 1.5), (13.0, 18.0, 1.5)
    axes = axes_towards(start, goal)
    obstacles = ObstacleSet((box("a", 4.0, 6.0, 1.5), box("b", 7.0, 10.0, 1.5, 0.5, 3.0, 9.0)))
    here, there = axes @ start, axes @ goal

    def corner(place: np.ndarray, side: int) -> tuple[float, float, float]:
        return float(place[0] + side), float(place[1] + 4 * side), float(place[2] + side)

    plan = plan_among(MovingProblem(
        obstacles, tuple(here.tolist()), tuple(there.tolist()), (0.15, 0.15, 0.1),
        corner(here, -1), corner(there, 1), axes=axes,
    ))  # fmt: skip
    assert plan is not None and gap(plan, obstacles) > 0
    np.testing.assert_allclose(plan.derivative(np.array([0.0, 1e9])), [start, goal], atol=1e-9)


def test_a_gate_that_opens_is_waited_for_and_one_that_stays_shut_has_no_plan() -> None:
    shut = box("gate", 15.0, 0.0, 1.5, 1.0, 9.0, 9.0)
    assert plan_among(problem(ObstacleSet((shut,)))) is None
    away = replace(shut, motion=WayPoints(((0.0, 0.0, 0.0), (0.0, 0.0, 0.1), (0.0, 0.0, 20.0)), 0.9))
    opening = ObstacleSet((away,))
    plan = plan_among(problem(opening))
    assert plan is not None and gap(plan, opening) > 0 and plan.duration > 7
    with pytest.raises(InvalidInputError, match="no way between the obstacles was found"):
        Replanner(problem(ObstacleSet((shut,))))


def test_a_safe_plan_is_kept_and_an_unsafe_one_is_replaced_without_a_jump() -> None:
    replanner = Replanner(problem(walkers(2)))
    first = replanner.plan
    for time in np.arange(0, 1.0, 0.1):
        update = replanner.update(float(time))
        assert update.safe and not update.changed and update.plan is first
    ahead = first.derivative(np.array([3.5]))[0]
    dropped = ObstacleSet((*walkers(2).obstacles, box("dropped", *ahead.tolist())))
    assert gap(first, dropped) == 0
    replanner.announce(dropped)
    update = replanner.update(1.0)
    assert update.changed and update.safe and gap(update.plan, dropped) > 0
    times = np.linspace(0, 1.0, 101)
    np.testing.assert_allclose(update.plan.derivative(times), first.derivative(times), atol=1e-12)
    for order, most in ((1, 5.0), (2, 20.0), (3, 100.0)):
        assert (worst(update.plan, order) <= most * (1 + 1e-6)).all()


def test_a_better_plan_replaces_the_present_one_by_the_stated_margin_only() -> None:
    crossing = box("crossing", 12.0, -1.5, 1.5, 1.0, 9.0, 9.0)
    slow = ObstacleSet((replace(crossing, motion=ConstantVelocity((0.0, 0.6, 0.0))),))
    replanner = Replanner(problem(slow))
    duration = replanner.plan.duration
    assert duration > 9
    replanner.announce(ObstacleSet(()))
    update = replanner.update(0.5)
    assert update.changed and update.plan.duration < 0.95 * duration
    assert not replanner.update(0.6).changed


def test_a_way_that_is_closed_in_flight_is_reported_as_unsafe() -> None:
    replanner = Replanner(problem(ObstacleSet(())))
    replanner.announce(ObstacleSet((box("wall", 15.0, 0.0, 1.5, 1.0, 9.0, 9.0),)))
    update = replanner.update(0.5)
    assert not update.safe and not update.changed


CASES = itertools.product((0.0, 0.4, 1.2), (0.0, 0.3, 5.0, 100.0), (0, 5))


@pytest.mark.parametrize(("step", "remaining", "wait"), CASES)
def test_progress_keeps_its_steps_and_ends_at_rest(step: float, remaining: float, wait: int) -> None:
    most, gain = 1.25, 0.4
    found = progress(step, remaining, most, gain, wait)
    braking = sum(step * share for share in np.linspace(1, 0, int(np.ceil(step / gain)) + 1)[1:])
    if found is None:
        assert remaining < braking
        return
    assert sum(found) == pytest.approx(remaining, abs=1e-9) and found[-1] == 0.0
    assert min(found) >= 0 and max(found) <= max(most, step) + 1e-9
    assert np.abs(np.diff([step, *found])).max() <= gain + 1e-9
    assert not wait or found.count(0.0) > wait


def test_ends_outside_the_region_and_a_goal_behind_are_refused() -> None:
    for changes in ({"start": (0.0, 9.0, 1.5)}, {"goal": (-0.5, 0.0, 1.5)}, {"goal": (float("nan"), 0.0, 1.5)}):
        with pytest.raises(InvalidInputError):
            problem(ObstacleSet(()), **changes)
    with pytest.raises(InvalidInputError):
        MovingConfig(parts=3)
    with pytest.raises(InvalidInputError):
        MotionLimits(jerk=0.0)
    steps = Steps.of(MotionLimits(), 0.25)
    assert 4 * steps.y <= 100 * 0.25**3 and 2 * steps.z <= 9 * 0.25**2
