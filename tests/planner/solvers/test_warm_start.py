"""Going on with a plan from where the robot really is."""

import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import so3
from nerfnav.planner.solvers.warm_start import shift_warm_start
from nerfnav.planner.space.astar import waypoints_along
from nerfnav.robots.state import Motion, RigidState
from tests.planner.places import ROBOT

START, GOAL = RigidState.at_rest((-0.5, 0, 0.4), 3.0), RigidState.at_rest((0.5, 0.2, 0.4), -3.0)


def planned(steps: int = 20) -> Motion:
    waypoints = waypoints_along(torch.stack([START.position, GOAL.position]), START, GOAL, steps)
    free = ROBOT.encode(waypoints, START, GOAL, 0.1)
    return ROBOT.motion(free, START, GOAL, steps, 0.1)


def test_without_a_deviation_the_rest_of_the_motion_stays_as_it_was():
    motion = planned()
    for executed in (1, 3):
        rest = shift_warm_start(motion, motion.states[executed], GOAL, ROBOT, executed=executed)
        assert rest.steps == 20 - executed
        again = rest.motion(ROBOT)
        torch.testing.assert_close(again.states.position, motion.states.position[executed:], rtol=0, atol=2e-4)
        torch.testing.assert_close(again.states.rotation, motion.states.rotation[executed:], rtol=0, atol=2e-2)


def test_a_deviation_fades_until_the_goal_and_shakes_the_robot_little():
    motion = planned()
    kick = torch.tensor([0.02, -0.02, 0.01, 0.01, 0.02, -0.01, 0.02, -0.02, 0.01, 0.02, 0.0, 0.01])
    start = motion.states[1].retract(kick)
    moved = shift_warm_start(motion, start, GOAL, ROBOT).motion(ROBOT)
    torch.testing.assert_close(moved.states.position[0], start.position)
    torch.testing.assert_close(moved.states.position[-1], GOAL.position)
    away = (moved.states.position - motion.states.position[1:]).norm(dim=-1)
    assert away.max() < 0.1 and away[-4:].max() < 1e-3
    assert ROBOT.limits(moved) == 0
    at_once = torch.cat([motion.states.position[1:], so3.yaw_of(motion.states.rotation[1:])[:, None]], -1)
    jerky = ROBOT.motion(ROBOT.encode(at_once, start, GOAL, 0.1), start, GOAL, 19, 0.1)
    fastest, jerky_fastest = (m.states.body_rate.norm(dim=-1).max() for m in (moved, jerky))
    assert fastest < 0.6 * jerky_fastest


def test_near_the_goal_the_horizon_does_not_shrink_below_what_the_robot_can_plan():
    motion = planned(5)
    late = shift_warm_start(motion, motion.states[3], GOAL, ROBOT, executed=3)
    assert late.steps == ROBOT.minimum_steps
    assert torch.isfinite(late.motion(ROBOT).actions).all()


def test_a_longer_horizon_waits_at_the_goal():
    motion = planned()
    longer = shift_warm_start(motion, motion.states[15], GOAL, ROBOT, executed=15, steps=10)
    states = longer.motion(ROBOT).states
    assert longer.steps == 10
    torch.testing.assert_close(states.position[6:], GOAL.position.expand(5, 3), rtol=0, atol=1e-5)


@pytest.mark.parametrize(("executed", "steps"), [(1, 18), (21, 5)])
def test_a_horizon_that_does_not_hold_the_rest_is_refused(executed: int, steps: int):
    motion = planned()
    with pytest.raises(InvalidInputError, match="does not hold"):
        shift_warm_start(motion, START, GOAL, ROBOT, executed=executed, steps=steps)
