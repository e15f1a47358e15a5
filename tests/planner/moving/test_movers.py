"""Movers: boxes and distances at their times, the timing of a path, and plans that go around or wait."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from nerfnav.core.steps import run_steps
from nerfnav.field import Field, VoxelField
from nerfnav.field.core.occupancy import EMPTY_RAW
from nerfnav.obstacles import BoxShape, ConstantVelocity, Cylinder, Obstacle, Sphere
from nerfnav.planner import FLYABLE, CostWeights, FastPlanConfig, PlanOutcome, PlanProblem, TermContext
from nerfnav.planner.moving.movers import Movers
from nerfnav.planner.moving.timing import PathTiming, time_along
from nerfnav.planner.objective.objective import Objective
from nerfnav.planner.objective.safety import assess_safety
from nerfnav.planner.solvers.fast import plan_fast
from nerfnav.planner.solvers.warm_start import replan_from
from nerfnav.planner.terms.movers import movers_term
from nerfnav.robots import RigidState
from tests.planner.places import BOX, ROBOT, Fog, Wall, straight_motion

START, GOAL = RigidState.at_rest((-0.7, 0.0, 0.5)), RigidState.at_rest((0.7, 0.1, 0.5))
EMPTY = Fog(rho=0.0)
GRID = VoxelField(BOX, torch.full((41, 41, 21, 4), EMPTY_RAW), torch.ones(3))


def crossing(speed: float, at: float = 1.0, edge: float = 0.3, yaw: float = 0.4) -> Movers:
    """A box that crosses the middle of the box at a time."""
    motion = ConstantVelocity((0.0, speed, 0.0))
    return Movers((Obstacle("box", BoxShape((edge, edge, edge)), (0.0, -speed * at, 0.5), (0.0, 0.0, yaw), motion),))


def test_boxes_hold_obstacles_and_the_robot_at_each_time() -> None:
    motion = ConstantVelocity((0.5, 0.0, 0.1))
    tall = Obstacle("post", Cylinder(0.1, 1.0), (0.2, 0.0, 0.5), (0.3, 0.2, 0.1), motion)
    ball = Obstacle("ball", Sphere(0.2), (-0.5, 0.3, 0.5), motion=ConstantVelocity((0.0, -1.0, 0.0)))
    movers, draws = Movers((tall, ball)), np.random.default_rng(0)
    times = np.array([0.0, 0.7, 2.0])
    for time, gaps in zip(times, _gaps_of(movers, times, draws), strict=True):
        for index, obstacle in enumerate(movers.obstacles):
            points, found = gaps
            bodies = ROBOT.body.points_body.double().numpy() + points[:, None]
            exact = obstacle.signed_distance(bodies.reshape(-1, 3), time).reshape(bodies.shape[:2]).min(-1)
            assert (found[:, index] <= exact + 1e-6).all(), "a distance from the enlarged box is never too large"
            assert (found[exact <= 0, index] <= 1e-6).all()
    assert movers.speed_bound == 1.0


def _gaps_of(movers: Movers, times: np.ndarray, draws: np.random.Generator) -> list[tuple[np.ndarray, np.ndarray]]:
    found = []
    for time in times:
        points = draws.uniform(-1, 1, (400, 3))
        found.append((points, movers.boxes(np.full(len(points), time), ROBOT.body).gaps(points)))
    return found


def test_a_step_touches_a_mover_that_passes_between_two_way_points() -> None:
    motion = straight_motion((-0.5, 0.0, 0.5), (0.5, 0.0, 0.5), steps=10)
    dart = Obstacle("dart", Sphere(0.05), (0.0, -4.55, 0.5), motion=ConstantVelocity((0.0, 10.0, 0.0)))
    gaps = Movers((dart,)).least_gaps(motion.states, motion.dt, ROBOT.body, 0.0)
    assert [step for step, gap in enumerate(gaps) if gap <= 0] == [4]
    later = Movers((dart,)).least_gaps(motion.states, motion.dt, ROBOT.body, 0.5)
    assert (later > 0).all(), "the flight began when the dart was gone"
    broken = motion.states.map(lambda part: part * torch.nan)
    assert np.isinf(Movers((dart,)).least_gaps(broken, motion.dt, ROBOT.body, 0.0)).all()


@pytest.mark.parametrize(("field", "compiled"), [(EMPTY, False), (GRID, True)])
@pytest.mark.parametrize("speed", [0.3, 2.0])
def test_the_cost_of_movers_and_its_derivative_are_those_of_its_twin(
    speed: float, field: Field, compiled: bool
) -> None:
    problem = PlanProblem(field, ROBOT, START, GOAL, 20, 0.1, movers=crossing(speed), time=0.3)
    context = TermContext(field, ROBOT, CostWeights())
    trajectory = problem.trajectory_through(torch.cat([
        START.position + torch.linspace(0, 1, 21)[:, None] * (GOAL.position - START.position), torch.zeros(21, 1),
    ], -1))  # fmt: skip
    free = trajectory.free.double().numpy() + 0.01 * np.random.default_rng(0).standard_normal(len(trajectory.free))
    objective = Objective(context, problem.route, problem.counted)
    assert (objective.fused is not None) == compiled
    found = objective(free)
    moved = trajectory.with_free(torch.from_numpy(free).float()).motion(ROBOT)
    assert found.cost.movers == pytest.approx(
        movers_term(crossing(speed), 0.3).cost(context, moved).item(), rel=1e-3
    )
    assert problem.cost(moved, CostWeights()).total.item() == pytest.approx(found.cost.total, rel=1e-3)
    direction, step = np.random.default_rng(1).standard_normal(len(free)), 1e-6
    ahead, behind = (objective(free + side * step * direction).cost.total for side in (1, -1))
    assert (ahead - behind) / (2 * step) == pytest.approx(found.gradient @ direction, rel=1e-3)


@pytest.mark.parametrize(("at", "steps"), [(0.1, 20), (1.0, 40), (2.6, 20)])
def test_timing_goes_before_a_mover_or_waits_for_it(at: float, steps: int) -> None:
    path = np.array([[-0.7, 0.0, 0.5], [0.7, 0.0, 0.5]])
    movers, timing = crossing(0.4, at), PathTiming(0.0, steps, 0.1, 0.0, 3.0, 20.0, 0.05)
    share = time_along(path, movers, ROBOT.body, timing)
    assert share is not None and share[0] == 0 and share[-1] == 1 and (np.diff(share) >= 0).all()
    places = np.stack([np.interp(share, [0, 1], axis) for axis in path.T], -1)
    assert movers.boxes(0.1 * np.arange(steps + 1), ROBOT.body).gaps(places).min() >= 0.05


def test_there_is_no_timing_where_a_mover_stays_or_passes_too_late() -> None:
    path = np.array([[-0.7, 0.0, 0.5], [0.7, 0.0, 0.5]])
    timing, motion = PathTiming(0.0, 20, 0.1, 0.0, 3.0, 20.0, 0.05), ConstantVelocity((0.0, 0.0, 1e-3))
    stays = Movers((Obstacle("box", BoxShape((0.3, 2.0, 2.0)), (0.0, 0.0, 0.5), motion=motion),))
    for movers in (stays, crossing(0.4, 1.0)):
        assert time_along(path, movers, ROBOT.body, timing) is None


@pytest.mark.parametrize("speed", [0.2, 0.6, 1.5])
def test_a_plan_goes_clear_of_a_box_that_crosses_it(speed: float) -> None:
    alone = PlanProblem(EMPTY, ROBOT, START, GOAL, 20, 0.1)
    with_box = replace(alone, movers=crossing(speed))
    straight, around = (run_steps(plan_fast(problem)) for problem in (alone, with_box))
    assert with_box.touches_movers(straight.motion) and not alone.touches_movers(straight.motion)
    assert around.outcome in FLYABLE and not with_box.touches_movers(around.motion)
    assert around.cost.movers > 0 and around.cost.total < straight.cost.total + 100
    safety = assess_safety(EMPTY, straight.motion, ROBOT.body, movers=with_box.movers)
    assert safety.bound == 1 and safety.min_clearance_m == 0
    on_grid = replace(with_box, field=GRID)
    found = run_steps(plan_fast(on_grid))
    assert found.outcome in FLYABLE and found.cost.movers > 0
    assert on_grid.movers is not None
    assert on_grid.movers.least_gaps(found.motion.states, 0.1, ROBOT.body, 0.0).min() > 0.05
    assert assess_safety(EMPTY, around.motion, ROBOT.body, movers=with_box.movers).bound < 0.5


def test_a_plan_through_a_door_waits_for_what_passes_the_door() -> None:
    start, goal = RigidState.at_rest((-0.6, 0.5, 0.5)), RigidState.at_rest((0.6, 0.5, 0.5))
    sinks = ConstantVelocity((0.0, 0.0, -0.9))
    gate = Obstacle("gate", BoxShape((0.3, 0.6, 4.0)), (0.0, 0.5, 0.5), motion=sinks)
    problem = PlanProblem(Wall(), ROBOT, start, goal, 20, 0.1, movers=Movers((gate,)))
    found = run_steps(plan_fast(problem))
    assert found.outcome in FLYABLE and not problem.touches_movers(found.motion)
    assert len(found.motion.actions) > 20, "the door is free after 2.8 s"
    assert found.motion.actions.shape[0] * 0.1 > 2.5


def test_a_way_that_is_closed_for_good_is_said_to_be() -> None:
    start, goal = RigidState.at_rest((-0.6, 0.5, 0.5)), RigidState.at_rest((0.6, 0.5, 0.5))
    plug = Obstacle("plug", BoxShape((0.3, 0.8, 2.0)), (0.0, 0.5, 0.5), motion=ConstantVelocity((0.0, 1e-3, 0.0)))
    problem = PlanProblem(Wall(), ROBOT, start, goal, 20, 0.1, movers=Movers((plug,)))
    assert run_steps(plan_fast(problem)).outcome is PlanOutcome.IN_COLLISION


def test_a_plan_that_is_clear_is_kept_and_one_that_is_touched_is_made_anew() -> None:
    problem = PlanProblem(EMPTY, ROBOT, START, GOAL, 20, 0.1, movers=crossing(0.6))
    clear = run_steps(plan_fast(problem))
    now = clear.motion.states[3]
    later = replace(problem, start=now, steps=17, time=0.3)
    kept = run_steps(replan_from(later, clear.motion, 3, FastPlanConfig()))
    assert kept.restart is None and kept.outcome in FLYABLE and not later.touches_movers(kept.motion)
    alone = run_steps(plan_fast(replace(problem, movers=None)))
    anew = run_steps(replan_from(replace(later, start=alone.motion.states[3]), alone.motion, 3, FastPlanConfig()))
    assert anew.outcome in FLYABLE and not later.touches_movers(anew.motion)
