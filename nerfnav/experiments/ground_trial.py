"""Trial of robots on the ground: one drive, planned and judged."""

import torch

from nerfnav import robots
from nerfnav.errors import OccupiedError
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.drives import Drive
from nerfnav.experiments.ground_results import Way
from nerfnav.experiments.heading_held import HEADING_HELD
from nerfnav.experiments.study import Row
from nerfnav.geometry import so3
from nerfnav.planner import (
    PlanProblem,
    PlanStep,
    collision_probability_bound,
    last_step,
    plan_fast,
    terms,
)
from nerfnav.robots import Motion, unwrapped
from nerfnav.world import judge

_STEPS, _DT = 30, 0.1
"""Length of a drive: 3 s."""


def drive(arena: Arena, item: Drive) -> tuple[Row, Way] | None:
    """Plan one drive and judge it; also its way. None where the field has something dense at one of the ends."""
    try:
        planned = plan_of(arena, item)
    except OccupiedError:
        return None
    robot, motion = robots.load(item.task.robot), planned.motion
    report = judge(arena.scene, robot.body, motion.states)
    yaw = unwrapped(so3.yaw_of(motion.states.rotation))
    row: Row = {
        "task": item.task.name,
        "robot": item.task.robot,
        "heading_held": item.held,
        "height_m": item.task.start[2],
        "outcome": planned.outcome.name.lower() if planned.outcome else "",
        "touched": bool(report.touched_poses.any()),
        "max_overlap_m3": report.max_overlap_m3,
        "lateral_speed_max_mps": lateral_speed(motion),
        "goal_missed_by_m": (motion.states.position[-1] - item.task.goal_state.position).norm().item(),
        "turned_rad": yaw.diff().abs().sum().item(),
        "bound": collision_probability_bound(arena.field, motion, robot.body),
    }
    return row, torch.cat([motion.states.position[:, :2], yaw[:, None]], -1).tolist()


def plan_of(arena: Arena, item: Drive) -> PlanStep:
    """The fast planner's plan."""
    start, goal = item.task.start_state, item.task.goal_state
    counted = (*terms.counted(), HEADING_HELD) if item.held else terms.counted()
    problem = PlanProblem(arena.field, robots.load(item.task.robot), start, goal, _STEPS, _DT, counted)
    return last_step(plan_fast(problem))


def lateral_speed(motion: Motion) -> float:
    """Largest velocity across the heading [m/s]."""
    return (motion.states.rotation[..., 1] * motion.states.velocity).sum(-1).abs().max().item()
