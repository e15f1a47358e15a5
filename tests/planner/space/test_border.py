"""The border of a field's box: a body stays inside, all of it, for J, for maps, for judges and for ends alike."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from nerfnav.core.errors import OccupiedError
from nerfnav.core.steps import run_steps
from nerfnav.geometry import so3
from nerfnav.geometry.box import Box
from nerfnav.planner import terms
from nerfnav.planner.objective.objective import Objective
from nerfnav.planner.objective.problem import PlanProblem
from nerfnav.planner.objective.safety import SafetyConfig, assess_safety, judge_search, measure_clearance
from nerfnav.planner.planners.planner import with_risk
from nerfnav.planner.risk.costs import CostWeights, collision_probability_bound
from nerfnav.planner.solvers.adam import PlanConfig, plan
from nerfnav.planner.solvers.fast import FastPlanConfig, plan_fast
from nerfnav.planner.space.border import SOLID_BEYOND, bordered_density, is_beyond, outside, reach_of
from nerfnav.planner.space.ends import check_ends, fits, nearest_free_pose
from nerfnav.planner.space.occupancy import OccupancyConfig, OccupancyMap
from nerfnav.planner.steps import FLYABLE, PlanCost, PlanOutcome
from nerfnav.planner.terms.term import CostTerm
from nerfnav.robots import load
from nerfnav.robots.state import Motion, RigidState
from tests.planner.objective.test_objective import ROUTE, room
from tests.planner.places import BOX, ROBOT, Fog, Wall, across, ball, straight_motion
from tests.planner.test_objective import guess

OPEN = Fog(rho=0.0)
ALONG, OVER = straight_motion((-0.7, 0.9, 0.4), (0.7, 0.9, 0.4)), straight_motion((-0.7, 0.97, 0.4), (0.7, 0.97, 0.4))
"""Ways of a body 10 cm wide in the open, its centre inside the box: all of it is inside, and its side reaches 2 cm
beyond."""


def beyond(problem: PlanProblem, motion: Motion) -> bool:
    return bool(is_beyond(problem.field.box, problem.robot.body.points_at(motion.states)).any())


def test_what_is_beyond_the_border_is_solid_and_the_border_itself_is_inside():
    points = torch.tensor([[1.0, 0.0, 0.5], [1.001, 0.0, 0.5], [0.0, 0.0, 0.0], [0.0, -1.2, 0.5]])
    assert is_beyond(BOX, points).tolist() == [False, True, False, True]
    assert bordered_density(Fog(rho=2.0), points).tolist() == pytest.approx([2.0, SOLID_BEYOND, 2.0, SOLID_BEYOND])


def test_a_plan_along_the_border_whose_body_would_reach_beyond_is_not_called_converged():
    problem, found = across(OPEN), {}
    for name, motion in (("along", ALONG), ("over", OVER)):
        found[name] = judge_search(problem, motion, PlanCost(0.0, 1.0, 0.0), PlanOutcome.CONVERGED)
    assert found["over"] is PlanOutcome.IN_COLLISION
    assert found["along"] is PlanOutcome.CONVERGED
    assert collision_probability_bound(OPEN, OVER, ROBOT.body) == 1 == assess_safety(OPEN, OVER, ROBOT.body).bound
    assert collision_probability_bound(OPEN, ALONG, ROBOT.body) == 0


def test_the_border_is_as_near_as_something_solid_is():
    assert measure_clearance(OPEN, ALONG, ROBOT.body, SafetyConfig()) == pytest.approx(0.05, abs=1e-6)
    assert measure_clearance(OPEN, OVER, ROBOT.body, SafetyConfig()) == 0
    assert measure_clearance(OPEN, ALONG, ROBOT.body, SafetyConfig(reach=0.04)) is None
    near = straight_motion((-0.7, 0.4, 0.4), (0.7, 0.4, 0.4))  # the ball is nearer
    to_ball = measure_clearance(ball(), near, ROBOT.body, SafetyConfig())
    assert to_ball is not None and to_ball < 0.15


@pytest.mark.parametrize("name", ["quadrotor", "couch"])
def test_maps_have_no_place_for_a_body_that_would_reach_beyond(name: str):
    body, height = load(name).body, 0.5
    occupancy = OccupancyMap.of(OPEN, body, OccupancyConfig(voxel=0.04), height)
    headings = len(occupancy.by_heading)
    assert (headings == 1) == (name == "quadrotor")
    for heading, places in enumerate(occupancy.by_heading[..., 0]):
        turned = so3.from_yaw(torch.tensor(heading * math.pi / headings))
        centers = occupancy.centers(torch.cat([torch.ones_like(places).nonzero(), torch.zeros(places.numel(), 1)], -1))
        points = body.points_body @ turned.T + centers[:, None]
        assert (is_beyond(BOX, points).any(-1) == places.flatten()).all()


def test_maps_of_all_heights_keep_a_body_off_floor_and_ceiling():
    occupied = OccupancyMap.of(OPEN, ROBOT.body, OccupancyConfig(voxel=0.04)).occupied
    assert occupied[..., 0].all() and occupied[..., -1].all() and not occupied[2:-2, 2:-2, 1:-1].any()
    assert OccupancyMap.of(OPEN, ROBOT.body, OccupancyConfig(voxel=0.04), 0.01).occupied.all(), "half of it is below"


def test_the_penalty_begins_before_the_body_reaches_the_border_and_grows_by_the_square():
    reach = reach_of(ROBOT.body)[1]
    away = [float(1 - reach - before) for before in (0.02, -0.01, -0.02)]
    spent = [outside(BOX, straight_motion((0, y, 0.5), (0, y, 0.5), 1), ROBOT.body).item() for y in away]
    assert 0.05 < reach < 0.06 and spent[0] == 0
    assert spent[1:] == pytest.approx([2 * 0.01**2, 2 * 0.02**2], rel=0.2)
    turned = straight_motion((0, away[0], 0.5), (0, away[0], 0.5), 1)
    states = replace(turned.states, rotation=so3.from_yaw(torch.tensor(math.pi / 4)).expand(2, 3, 3))
    assert outside(BOX, replace(turned, states=states), ROBOT.body) > 0, "its corners reach farther than its sides"


def test_the_compiled_penalty_is_that_of_the_reference_and_its_gradient_that_of_finite_differences():
    step, spread = 1e-6, 1.0  # leaves the box, tilted
    context = PlanProblem(room(), ROBOT, ROUTE.start, ROUTE.goal, ROUTE.steps, ROUTE.dt).context(CostWeights(limits=0))
    nothing = CostTerm("nothing", lambda context, motion: 0 * motion.actions.sum((-2, -1)))
    alone = tuple(term for term in terms.list_terms() if term.name == "outside")
    j = Objective(context, ROUTE, (*alone, nothing))
    free = guess(spread)
    here, motion = j(free), ROBOT.motion(
        torch.from_numpy(free), ROUTE.start.to(torch.float64), ROUTE.goal.to(torch.float64), ROUTE.steps, ROUTE.dt
    )  # fmt: skip
    expected = 1000 * outside(BOX, motion, context.body).item()
    assert here.cost.limits == pytest.approx(expected, rel=1e-6) and expected > 1
    for index in range(len(free)):
        offset = step * np.eye(len(free))[index]
        slope = (j(free + offset).cost.total - j(free - offset).cost.total) / (2 * step)
        assert slope == pytest.approx(here.gradient[index], rel=1e-3, abs=1e-3 * np.abs(here.gradient).max())


@pytest.mark.parametrize("planner", ["fast", "fast with risk", "paper"])
def test_plans_between_something_and_the_border_keep_all_of_the_body_inside(planner: str):
    start, goal = RigidState.at_rest((-0.7, 0.88, 0.4)), RigidState.at_rest((0.7, 0.88, 0.4))
    problem = PlanProblem(ball(0.8), ROBOT, start, goal)  # 20 cm are left for 10
    if planner == "paper":
        last = run_steps(plan(problem, replace(PlanConfig.paper(), iterations=60)))
    else:
        last = run_steps(plan_fast(problem, with_risk(FastPlanConfig()) if "risk" in planner else FastPlanConfig()))
    assert last.outcome in FLYABLE and not beyond(problem, last.motion)


@pytest.mark.parametrize("risk", [False, True])
@pytest.mark.parametrize("door", [0.24, 0.26, 0.28])
def test_in_a_strait_no_plan_dives_through_the_floor(door: float, risk: bool):
    problem = across(Wall(door=door))
    last = run_steps(plan_fast(problem, with_risk(FastPlanConfig()) if risk else FastPlanConfig()))
    assert not beyond(problem, last.motion)
    assert last.outcome is not PlanOutcome.IN_COLLISION


def test_an_end_at_which_the_body_would_reach_beyond_is_refused_with_the_nearest_that_will_do():
    problem = across(OPEN)
    occupancy = OccupancyMap.of(OPEN, ROBOT.body, OccupancyConfig(voxel=0.04))
    low = RigidState.at_rest((0.0, 0.0, 0.01))
    assert not fits(OPEN, ROBOT.body, low) and fits(OPEN, ROBOT.body, RigidState.at_rest((0.0, 0.0, 0.02)))
    with pytest.raises(OccupiedError, match=r"so near the border of the field that the robot, .* m across, would"):
        check_ends(OPEN, ROBOT.body, low, problem.goal, occupancy)
    nearest = nearest_free_pose(OPEN, ROBOT.body, low, occupancy)
    assert nearest is not None and nearest.position.tolist() == pytest.approx([0.0, 0.0, 0.04])


def test_a_body_larger_than_the_box_has_no_way():
    small = Fog(Box.of((-0.04, -1, 0), (0.04, 1, 1)), rho=0.0)
    assert OccupancyMap.of(small, ROBOT.body, OccupancyConfig(voxel=0.04)).occupied.all()
