"""Plans that know the noise that will come: how far it takes a robot, and what they do about it."""

import math
from dataclasses import dataclass, replace

import numpy as np
import pytest
import scipy
import torch
from torch import Tensor

from nerfnav.core.steps import run_steps
from nerfnav.geometry import Box, so3
from nerfnav.planner import planners, terms
from nerfnav.planner.objective.objective import Objective
from nerfnav.planner.objective.problem import InitialGuess, PlanProblem, map_for, path_length, paths_between
from nerfnav.planner.objective.safety import SafetyConfig, measure_clearance
from nerfnav.planner.planners.fast import FastPlanner
from nerfnav.planner.planners.planner import RISK, with_risk
from nerfnav.planner.risk.collision_map import CollisionMap, _near, _weigh_along
from nerfnav.planner.risk.costs import CostWeights
from nerfnav.planner.risk.tracking_error import RiskContext, tracking_deviations
from nerfnav.planner.solvers.chance_constraint import enforce_chance_constraint, estimate_risk
from nerfnav.planner.solvers.fast import FastPlanConfig, plan_fast
from nerfnav.planner.solvers.warm_start import replan_from
from nerfnav.planner.space.astar import waypoints_along
from nerfnav.planner.space.occupancy import OccupancyConfig, OccupancyMap
from nerfnav.planner.steps import PlanOutcome, PlanResult, PlanStep
from nerfnav.planner.terms.risk import RISK as RISK_TERM
from nerfnav.planner.terms.risk import risk
from nerfnav.planner.terms.term import CostTerm
from nerfnav.planner.trajectory import Route
from nerfnav.robots import NoiseModel, StateNoise
from nerfnav.robots.couch import Couch
from nerfnav.robots.diffdrive import DiffDrive
from nerfnav.robots.quadrotor import Quadrotor
from nerfnav.robots.quadrotor_config import QuadrotorConfig
from nerfnav.robots.state import RigidState
from tests.planner.objective.test_objective import BOX, room
from tests.planner.places import ROBOT, Colorless, Wall, across, ball, straight_motion
from tests.planner.test_objective import DT, GOAL, START, STEPS, guess

PUSHED = NoiseModel(StateNoise(0.02, 0.0, 0.0, 0.0), StateNoise(0.0, 0.0, 0.0, 0.0))
"""Noise on the position alone, and a state that is known."""
PAPER, CAREFUL = FastPlanConfig(), FastPlanConfig(weights=CostWeights(risk=RISK))
WEIGHED = CostWeights(risk=RISK, collision=0.3)
PLANK = Quadrotor(QuadrotorConfig(extents=(0.3, 0.1, 0.04), point_counts=(7, 5, 2)))
LOW = replace(room(), box=Box(*(edge - torch.tensor([0.0, 0.0, 0.4]) for edge in (BOX.lower, BOX.upper))))
"""The ball of fog on the ground."""


@dataclass(frozen=True)
class Lawn(Colorless):
    """Solid ground up to a height of 0.1 m."""

    def density(self, points: Tensor) -> Tensor:
        ground = 200 * torch.sigmoid((0.1 - points[..., 2]) / 0.005)
        return torch.where(self.box.contains(points), ground, torch.zeros_like(ground))


@dataclass(frozen=True)
class Doors(Colorless):
    """A wall across the box at x = 0 with a narrow door in the middle and a wide one at its side."""

    def density(self, points: Tensor) -> Tensor:
        x, y, _ = points.unbind(-1)
        inside = torch.sigmoid((0.1 - x.abs()) / 0.01)
        narrow = torch.sigmoid((y.abs() - 0.12) / 0.01)
        wide = torch.sigmoid(((y - 0.75).abs() - 0.2) / 0.01)
        both = inside * narrow * wide
        return torch.where(self.box.contains(points), 200 * both, torch.zeros_like(both))


def _crossing(free: Tensor) -> float:
    """Where a way crosses x = 0 [m], from its free numbers (see quadrotor.py)."""
    steps = (len(free) + 12) // 4
    inner = free[2 : 2 + 3 * (steps - 4)].reshape(-1, 3)
    return inner[inner[:, 0].abs().argmin(), 1].item()


def planned(problem: PlanProblem, config: FastPlanConfig | None = None) -> PlanResult:
    step = run_steps(plan_fast(problem, config))
    assert step.outcome is PlanOutcome.CONVERGED
    return step


def expected(problem: PlanProblem, step: PlanStep) -> float:
    """Collisions to be expected of noise."""
    return risk(problem.context(CostWeights(risk=1.0)), step.motion).item()


def test_noise_grows_until_the_next_action_reaches_the_position():
    deviations = tracking_deviations(ROBOT, 0.1, PUSHED)
    assert [each.level for each in deviations] == pytest.approx([0.02 * math.sqrt(steps) for steps in (1, 2, 3, 4)])
    assert [each.height for each in deviations] == pytest.approx([0.02 * math.sqrt(steps) for steps in (1, 2, 2, 2)])
    for pushed, by_default in zip(deviations, tracking_deviations(ROBOT, 0.1, NoiseModel()), strict=True):
        assert pushed.level < by_default.level < 1.1 * pushed.level
        assert pushed.height < by_default.height < 1.1 * pushed.height
    assert tracking_deviations(DiffDrive(), 0.1, PUSHED)[-1].level == pytest.approx(0.04)  # to the side never reached


@pytest.mark.slow
def test_the_tracking_error_is_that_of_robots_without_control():
    draws, noise = torch.Generator().manual_seed(0), NoiseModel()
    std, known = noise.process.std(), noise.estimate.std()
    still = RigidState.at_rest((0.0, 0.0, 0.0))
    hover = ROBOT.hold(still, 0.1)
    ends = []
    for _ in range(600):
        state = still.retract(known * torch.randn(12, generator=draws))
        for _ in range(4):
            state = ROBOT.step(state, hover, 0.1).retract(std * torch.randn(12, generator=draws))
        ends.append(state.position)
    level = torch.stack(ends)[:, :2].std().item()
    assert level == pytest.approx(tracking_deviations(ROBOT, 0.1, noise)[-1].level, rel=0.08)


def test_the_chance_at_a_wall_is_the_tail_of_the_noise():
    risk_context, wall = RiskContext(noise=PUSHED), Wall(door=0.0)
    chances = CollisionMap.of(wall, ROBOT, risk_context)
    edge = 0.05 + 0.1 + 0.01 * math.log(200 / 5 - 1)  # half of the body, and where the wall's density falls below 5 / m
    for layer, deviation in zip(chances.chances, (0.02, 0.02 * 2**0.5, 0.02 * 3**0.5, 0.04), strict=True):
        row = layer[0, :, layer.shape[2] // 2, layer.shape[3] // 2]
        x = chances.lower[0] + np.arange(len(row)) / chances.per_meter[0]
        near = (x > 0) & (np.abs(x - edge) > 0.01)  # a node is 2.5 cm from the next
        tail = np.array([0.5 * math.erfc((at - edge) / deviation / math.sqrt(2)) for at in x])
        np.testing.assert_allclose(row[near], tail[near], atol=0.2 * 0.02 / deviation + 0.02)
        if deviation == 0.04:
            np.testing.assert_allclose(row[x > 0], tail[x > 0], atol=0.12)
        assert row[np.abs(x) < 0.02].min() > 0.99 and row[x > 0.35].max() < 1e-3


def test_what_is_near_in_time_is_less_uncertain_than_what_is_far():
    """Beside a wall a plan that stays there is soon at risk, one that leaves at once is not."""
    problem, wall = across(Wall(door=0.0)), 0.05 + 0.1 + 0.01 * math.log(200 / 5 - 1)
    here = (-(wall + 0.045), 0.0, 0.3)
    staying, leaving = straight_motion(here, here), straight_motion(here, (-0.9, 0.0, 0.3))
    context = problem.context(CostWeights(risk=1.0))
    stays, leaves = (risk(context, motion).item() for motion in (staying, leaving))
    sure, later = (0.5 * math.erfc(0.045 / spread / math.sqrt(2)) for spread in (0.0207, 0.0418))
    count = len(staying.actions)
    assert stays < count * later and stays == pytest.approx(count * later, rel=0.2)
    assert leaves < stays / 4 and leaves < 3 * later and sure < 0.2 * later


@pytest.mark.parametrize("axis", range(3))
def test_a_blur_along_an_axis_is_the_product_with_all_its_weights(axis: int) -> None:
    random = np.random.default_rng(axis)
    values = random.random((7, 8, 9), dtype=np.float32)
    away = np.abs(np.linspace(-1, values.shape[axis], 12)[:, None] - np.arange(values.shape[axis]))
    weights = np.where(away < 2, 2 - away, 0).astype(np.float32)  # fewer at the ends, where some are cut off
    blurred = _weigh_along(values, axis, *_near(weights))
    np.testing.assert_allclose(blurred, np.moveaxis(np.tensordot(weights, values, (1, axis)), 0, axis), atol=1e-6)
    assert _near(weights)[1].shape[1] == 4


def test_the_chance_beyond_the_box_is_that_at_its_border():
    problem = across(Wall(door=0.0))
    over = straight_motion((-0.1, 0.0, 1.05), (0.1, 0.0, 1.05))
    below = straight_motion((-0.1, 0.0, 1.0), (0.1, 0.0, 1.0))
    expected = [risk(problem.context(CostWeights(risk=1.0)), motion).item() for motion in (over, below)]
    assert expected[0] == pytest.approx(expected[1], rel=1e-5) and expected[0] > 5


def test_where_risk_counts_paths_avoid_what_noise_makes_costly():
    wall = Doors()
    problem = across(wall)
    occupancy = map_for(problem, FastPlanConfig().occupancy)
    short, safe = (
        paths_between(problem, InitialGuess.ASTAR, occupancy, config.ways).trajectories[0]
        for config in (PAPER, CAREFUL)
    )
    through = [_crossing(way.free) for way in (short, safe)]
    assert abs(through[0]) < 0.2 and through[1] > 0.5
    lengths = [path_length(problem, occupancy, config.ways) for config in (PAPER, CAREFUL)]
    assert lengths[1] > lengths[0] + 0.2


@pytest.mark.parametrize("overdue", [False, True])
@pytest.mark.parametrize("robot", [ROBOT, PLANK], ids=["square", "long"])
def test_the_compiled_term_is_that_of_the_reference_and_its_gradient_that_of_finite_differences(
    robot: Quadrotor, overdue: bool
):
    problem = PlanProblem(room(), robot, START, GOAL, STEPS, DT, overdue=overdue)
    nothing = CostTerm("nothing", lambda context, motion: 0 * motion.actions.sum((-2, -1)))
    j = Objective(problem.context(WEIGHED), problem.route, terms.list_terms())
    plain = Objective(problem.context(WEIGHED), problem.route, (*terms.list_terms(), nothing))
    assert j.fused is not None and plain.fused is None
    free, step = guess(0.02), 1e-6
    here, there = j(free), plain(free)
    ends = START.to(torch.float64), GOAL.to(torch.float64)
    at = torch.from_numpy(free).requires_grad_()
    found = problem.cost(robot.motion(at, *ends, STEPS, DT), WEIGHED)
    assert here.cost.risk > 1 and here.cost.risk == pytest.approx(found.numbers().risk, rel=1e-6)
    assert here.cost.risk == pytest.approx(there.cost.risk, rel=1e-9)
    (gradient,) = torch.autograd.grad(found.total, at)
    np.testing.assert_allclose(here.gradient, gradient, rtol=1e-4, atol=1e-5 * gradient.abs().max().item())
    np.testing.assert_allclose(here.gradient, there.gradient, rtol=1e-7, atol=1e-9 * np.abs(here.gradient).max())
    for index in range(len(free)):
        offset = step * np.eye(len(free))[index]
        slope = (j(free + offset).cost.total - j(free - offset).cost.total) / (2 * step)
        assert slope == pytest.approx(here.gradient[index], rel=1e-3, abs=1e-3)


def test_a_long_robot_on_the_ground_has_the_term_of_the_reference_too():
    couch, ends = Couch(), [replace(end, position=end.position * torch.tensor([1, 1, 0])) for end in (START, GOAL)]
    problem = PlanProblem(LOW, couch, *ends, 12, DT)
    waypoints = waypoints_along(torch.stack([end.position for end in ends]), *ends, 12)
    guessed = couch.encode(waypoints, *ends, DT).double().numpy()
    guessed = guessed + 0.02 * np.random.default_rng(0).standard_normal(guessed.shape)
    found = Objective(problem.context(WEIGHED), problem.route, (RISK_TERM,))(guessed)
    at = torch.from_numpy(guessed).requires_grad_()
    motion = couch.motion(at, *(end.to(torch.float64) for end in ends), 12, DT)
    expected = RISK * risk(problem.context(WEIGHED), motion)
    assert found.cost.risk > 1 and found.cost.risk == pytest.approx(expected.item(), rel=1e-6)
    (gradient,) = torch.autograd.grad(expected, at)
    assert gradient[2 * len(gradient) // 3 :].abs().max() > 0.1  # by its headings
    np.testing.assert_allclose(found.gradient, gradient, rtol=1e-4, atol=1e-5 * gradient.abs().max().item())


def test_a_long_robot_goes_through_a_strait_lengthwise():
    """Its ends ask for its broad side; there is room for that everywhere but in the door."""
    wall, couch = Wall(door=0.36), Couch()
    aside = math.pi / 2
    start, goal = RigidState.at_rest((-0.7, 0.5, 0.4), aside), RigidState.at_rest((0.7, 0.5, 0.4), aside)
    problem = PlanProblem(wall, couch, start, goal, 24)
    free, careful = planned(problem), planned(problem, CAREFUL)
    states = careful.motion.states
    inside = states.position[:, 0].abs() < 0.1
    assert inside.any() and so3.yaw_of(states.rotation[inside]).sin().abs().max() < 0.35
    assert expected(problem, careful) < 0.5 * expected(problem, free)


def test_maps_that_tell_headings_apart_know_with_which_of_them_noise_is_likely_to_hit():
    wall, couch = Wall(door=0.36), Couch()
    occupancy = OccupancyMap.of(wall, couch.body, OccupancyConfig(), 0.4)
    chances = CollisionMap.of(wall, couch, RiskContext(height=0.4))
    found = chances.sample_voxels(occupancy)
    assert found.shape == occupancy.by_heading.shape and len(found) > 4
    x, y = ((at - occupancy.box.lower[axis].item()) / occupancy.spacing[axis].item() for axis, at in ((0, 0), (1, 0.5)))
    door = found[:, round(x), round(y), 0]
    assert door.argmin() == 0 and door[len(door) // 2] > door[0] + 0.2
    centre = occupancy.centers(torch.tensor([[round(x), round(y), 0]])).double().numpy()[0]
    at = (centre - chances.lower) * chances.per_meter
    exact = scipy.ndimage.map_coordinates(chances.chances[-1, 0], at[:, None], order=1)
    np.testing.assert_allclose(door[0], exact[0], atol=1e-6)
    single = OccupancyMap.of(wall, couch.body, OccupancyConfig(headings=1), 0.4)
    np.testing.assert_array_equal(chances.sample_voxels(single)[0] <= found.min(0) + 1e-6, True)


def test_without_weight_risk_is_no_part_of_a_plan_and_so_it_is_in_the_paper():
    problem = across(ball())
    off = planned(problem)
    assert off.cost.risk == 0 and off.cost.total == off.cost.collision + off.cost.control + off.cost.limits
    paper = planners.load("paper")
    assert paper.config().weights.risk == 0 and paper.again(paper.config()).weights.risk == 0
    fast = planners.load("fast")
    assert fast.again(fast.config()).weights.risk == RISK
    assert with_risk(FastPlanConfig(weights=CostWeights(risk=7.0))).weights.risk == 7.0


def test_a_plan_that_counts_risk_keeps_wider_of_what_is_solid():
    problem = across(Wall(door=0.6))
    near, wide = planned(problem), planned(problem, CAREFUL)
    room_of = [
        measure_clearance(Wall(door=0.6), step.motion, ROBOT.body, SafetyConfig()) or 1.0 for step in (near, wide)
    ]
    assert room_of[1] > room_of[0] + 0.03
    assert expected(problem, wide) < 0.1 * expected(problem, near)
    assert wide.cost.control < 1.5 * near.cost.control


def test_a_plan_that_counts_risk_leaves_the_ground_early():
    start, goal = RigidState.at_rest((-0.7, 0.0, 0.15)), RigidState.at_rest((0.7, 0.0, 0.35))
    problem = PlanProblem(Lawn(), ROBOT, start, goal)
    low, high = (planned(problem, config).motion.states.position[:, 2] for config in (None, CAREFUL))
    assert (high[3:8] > low[3:8] + 0.03).all()


@pytest.mark.slow
def test_a_plan_that_counts_risk_goes_through_a_strait_all_the_same_and_in_fewer_steps():
    shares = []
    for door in (0.3, 0.302, 0.31):
        problem = across(Wall(door=door))
        slow, quick = planned(problem), planned(problem, CAREFUL)
        within = [int((step.motion.states.position[:, 0].abs() < 0.15).sum()) for step in (slow, quick)]
        assert 0 < within[1] <= within[0]
        middle = quick.motion.states.position[quick.motion.states.position[:, 0].abs() < 0.15][:, 1]
        assert (middle - 0.5).abs().max() < 0.03  # and amid the door
        shares.append(expected(problem, quick) / expected(problem, slow))
    # J has minima at 0.4 and 0.8 of the risk there, and which of them is found depends on the rounding
    assert max(shares) < 0.9 and np.median(shares) < 0.7


@pytest.mark.slow
def test_a_robot_whose_arrival_is_put_off_does_not_wait_outside_of_a_strait():
    wall = Wall(door=0.3)
    start, goal = RigidState.at_rest((-0.35, 0.5, 0.4)), RigidState.at_rest((0.0, 0.5, 0.4))
    planner = FastPlanner(wall, ROBOT, CAREFUL, CAREFUL)
    step, state = run_steps(planner.plan(Route(start, goal, 8))), start
    for _ in range(16):
        state = ROBOT.step(state, step.motion.actions[0], 0.1)
        left = max(len(step.motion.actions) - 1, 6)
        step = run_steps(planner.replan(step.motion, Route(state, goal, left), executed=1))
    assert (state.position - goal.position).norm() < 0.08


@pytest.mark.slow
def test_where_noise_makes_every_path_too_risky_the_plan_says_so_and_is_the_least_risky_found():
    problem = across(Wall(door=0.28))
    first = planned(problem, CAREFUL)
    last = run_steps(enforce_chance_constraint(problem, first, CAREFUL, 0.05))
    assert last.outcome is PlanOutcome.TOO_RISKY
    least, begun = (estimate_risk(problem, step, CAREFUL.weights) for step in (last, first))
    assert 0.05 < least <= begun
    little = StateNoise(0.001, 0.001, 0.001, 0.001)
    calm = replace(problem, noise=NoiseModel(little, little))
    assert (
        run_steps(enforce_chance_constraint(calm, planned(calm, CAREFUL), CAREFUL, 0.05)).outcome
        is PlanOutcome.CONVERGED
    )


def near_ground(height: float) -> PlanProblem:
    """A robot 30 cm above its goal, which is at a height [m] where noise may push it into the ground."""
    start, goal = RigidState.at_rest((0.0, 0.0, height + 0.3)), RigidState.at_rest((0.0, 0.0, height))
    return PlanProblem(Lawn(BOX), ROBOT, start, goal, 6, DT)


@pytest.mark.slow
def test_a_robot_in_noise_comes_down_to_a_goal_at_which_noise_may_push_it_into_the_ground() -> None:
    problem, noise, draws = near_ground(0.16), StateNoise(), torch.Generator().manual_seed(0)
    chances = CollisionMap.of(problem.field, ROBOT, problem.risk_context)
    assert 0.05 < chances.grid(RiskContext(end=(0.0, 0.0, 0.16, 0.0)))[3] < 0.5
    state, last, heights = problem.start, run_steps(plan_fast(problem, CAREFUL)).motion, []
    for _ in range(60):
        state = ROBOT.step(state, last.actions[0], DT).retract(noise.sample(draws))
        last = run_steps(replan_from(replace(problem, start=state), last, 1, CAREFUL)).motion
        heights.append(state.position[2].item() - 0.16)
    assert -0.02 < np.mean(heights[15:]) < 0.06, np.mean(heights[15:])


def test_chances_up_to_that_at_the_goal_count_as_none_where_the_arrival_is_put_off() -> None:
    problem = near_ground(0.16)
    late = replace(problem, overdue=True)
    assert problem.risk_context.end is None
    assert late.risk_context.end == pytest.approx((0.0, 0.0, 0.16, 0.0))
    down = straight_motion((0.0, 0.0, 0.46), (0.0, 0.0, 0.16), 6)
    lower = straight_motion((0.0, 0.0, 0.16), (0.0, 0.0, 0.13), 6)
    assert risk(problem.context(CAREFUL.weights), down) > 0
    assert risk(late.context(CAREFUL.weights), down) == pytest.approx(0, abs=1e-6)
    assert risk(late.context(CAREFUL.weights), lower) > 0


@pytest.mark.parametrize("robot", [ROBOT, PLANK], ids=["square", "long"])
def test_the_compiled_term_counts_chances_above_that_at_the_goal_as_the_reference_does(robot: Quadrotor) -> None:
    problem = PlanProblem(room(), robot, START, GOAL, STEPS, DT, overdue=True)
    chances, middle = CollisionMap.of(problem.field, robot, problem.risk_context), torch.zeros(3)
    ways = [GOAL.position + share * (middle - GOAL.position) for share in torch.linspace(0, 1, 40)]
    near = next(way for way in ways if chances.grid(RiskContext(end=(*way.tolist(), 0.0)))[3] > 0.05)
    problem = replace(problem, goal=replace(GOAL, position=near))
    j, free = Objective(problem.context(WEIGHED), problem.route, terms.list_terms()), guess(0.02)
    ends = START.to(torch.float64), problem.goal.to(torch.float64)
    at = torch.from_numpy(free).requires_grad_()
    found = problem.cost(robot.motion(at, *ends, STEPS, DT), WEIGHED)
    here = j(free)
    assert j.fused is not None and here.cost.risk > 0.1
    assert here.cost.risk == pytest.approx(found.numbers().risk, rel=1e-6)
    (gradient,) = torch.autograd.grad(found.total, at)
    np.testing.assert_allclose(here.gradient, gradient, rtol=1e-4, atol=1e-5 * gradient.abs().max().item())
