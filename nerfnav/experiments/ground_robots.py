"""Robots on the ground: a couch that must turn to pass a gap, and wheels that never slide.

Couch: each of its tasks is planned as it is, and those that begin and end with one heading again with this heading
held, by a term that is added to J. Only what can turn fits through a gap that is narrower than it is long.

Differential drive: each of its tasks is driven there, and back in reverse. A robot on wheels has no velocity across
its heading, at any time.

Planned on the field, judged on the mesh. Drives that the field does not allow to begin or end are counted as refused.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
import torch
import trimesh
from jaxtyping import Float
from torch import Tensor

from nerfnav import robots
from nerfnav.core.errors import OccupiedError
from nerfnav.core.steps import run_steps
from nerfnav.experiments.arena import Arena
from nerfnav.experiments.figures import COLORS, Axes, Figure, panels
from nerfnav.experiments.study import ExperimentSteps, Results, Row, Study, run_trials
from nerfnav.geometry import so3
from nerfnav.planner import (
    CostTerm,
    PlanProblem,
    PlanResult,
    TermContext,
    collision_probability_bound,
    plan_fast,
    terms,
)
from nerfnav.robots import Motion, unwrap_angles
from nerfnav.world import Task, judge

PlanarPath = list[list[float]]
"""x, y [m] and heading [rad] at each time."""
COUCH, WHEELS = "couch", "diffdrive"


def outlines(arena: Arena, height: float) -> np.ndarray:
    """Sections of the solids at a height [m]: line segments, (n, 2, 2)."""
    cuts = [trimesh.intersections.mesh_plane(solid, [0, 0, 1], [0, 0, height]) for solid in arena.scene.solids]
    return np.concatenate([np.reshape(cut, (-1, 2, 3))[..., :2] for cut in cuts])


def heading_held(_: TermContext, motion: Motion) -> Float[Tensor, "*batch"]:
    """Cost of turning away from the first attitude: squared angles [rad^2], summed over time."""
    rotation = motion.states.rotation
    turned = so3.local(rotation[..., :1, :, :].expand_as(rotation), rotation)
    return turned.square().sum((-2, -1))


HEADING_HELD = CostTerm("heading held", heading_held, 1e4)
"""Its weight, in units of J for a squared radian, lets the heading stray by less than a degree."""


@dataclass(frozen=True)
class Drive:
    """Trial of the experiment: one drive."""

    task: Task
    """Start, goal and robot."""
    held: bool = False
    """Hold the heading of the start."""


def drives_of(task: Task) -> list[Drive]:
    """The trials of a task: a heading can only be held where start and goal have the same."""
    if task.robot == WHEELS:
        back = replace(
            task, name=f"{task.name}, and back", start=task.goal, goal=task.start, start_yaw=task.goal_yaw,
            goal_yaw=task.start_yaw,
        )  # fmt: skip
        return [Drive(task), Drive(back)]
    return [Drive(task, held) for held in ((False, True) if task.start_yaw == task.goal_yaw else (False,))]


_STEPS, _DT = 30, 0.1
"""Length of a drive: 3 s."""


def drive(arena: Arena, item: Drive) -> tuple[Row, PlanarPath] | None:
    """Plan one drive and judge it; also its path. None where the field has something dense at one of the ends."""
    try:
        planned = plan_of(arena, item)
    except OccupiedError:
        return None
    robot, motion = robots.load(item.task.robot), planned.motion
    report = judge(arena.scene, robot.body, motion.states)
    yaw = unwrap_angles(so3.yaw_of(motion.states.rotation))
    row: Row = {
        "task": item.task.name,
        "robot": item.task.robot,
        "heading_held": item.held,
        "height_m": item.task.start[2],
        "outcome": planned.outcome.name.lower(),
        "touched": bool(report.touched_poses.any()),
        "max_overlap_m3": report.max_overlap_m3,
        "lateral_speed_max_mps": lateral_speed(motion),
        "goal_missed_by_m": (motion.states.position[-1] - item.task.goal_state.position).norm().item(),
        "turned_rad": yaw.diff().abs().sum().item(),
        "bound": collision_probability_bound(arena.field, motion, robot.body),
    }
    return row, torch.cat([motion.states.position[:, :2], yaw[:, None]], -1).tolist()


def plan_of(arena: Arena, item: Drive) -> PlanResult:
    """The fast planner's plan."""
    start, goal = item.task.start_state, item.task.goal_state
    counted = (*terms.list_terms(), HEADING_HELD) if item.held else terms.list_terms()
    problem = PlanProblem(arena.field, robots.load(item.task.robot), start, goal, _STEPS, _DT, counted)
    return run_steps(plan_fast(problem))


def lateral_speed(motion: Motion) -> float:
    """Largest velocity across the heading [m/s]."""
    return (motion.states.rotation[..., 1] * motion.states.velocity).sum(-1).abs().max().item()


def run(study: Study) -> ExperimentSteps:
    """Plan all drives of couches and differential drives; those of other robots are left out."""
    tasks = [task for task in study.tasks if task.robot in (COUCH, WHEELS)]
    drives = [one for task in study.first(tasks, "ground tasks") for one in drives_of(task)]
    answers = yield from run_trials(study, "planning", drive, drives)
    done = [answer for answer in answers if answer is not None]
    rows, paths = tuple(row for row, _ in done), [path for _, path in done]
    walls = outlines(study.open_arena(), rows[0]["height_m"]) if rows else np.empty((0, 2, 2))
    summary = {**summarize(rows), "refused": len(answers) - len(done)}
    figures = {"ground_robots": partial(draw_figure, rows, paths, walls)}
    return Results(summary, rows, figures, ("robot", "heading_held"))


def summarize(rows: Sequence[Row]) -> Row:
    """Overlaps of couches that may turn and may not, and whether wheels slid."""
    turning, held = ([row for row in rows if row["robot"] == COUCH and row["heading_held"] is so]
                     for so in (False, True))  # fmt: skip
    wheels = [row for row in rows if row["robot"] == WHEELS]
    return {
        "couch_drives": len(turning),
        "couch_touched": sum(row["touched"] for row in turning),
        "couch_max_overlap_m3": max((row["max_overlap_m3"] for row in turning), default=None),
        "couch_held_touched": sum(row["touched"] for row in held),
        "couch_held_max_overlap_m3": max((row["max_overlap_m3"] for row in held), default=None),
        "gap_overlap_m3": turning[0]["max_overlap_m3"] if turning else None,
        "gap_overlap_held_m3": held[0]["max_overlap_m3"] if held else None,
        "wheel_drives": len(wheels),
        "wheel_touched": sum(row["touched"] for row in wheels),
        "wheel_lateral_speed_max_mps": max((row["lateral_speed_max_mps"] for row in wheels), default=None),
        "goal_missed_max_m": max((row["goal_missed_by_m"] for row in rows), default=None),
    }


def draw_figure(rows: Sequence[Row], paths: Sequence[PlanarPath], walls: np.ndarray) -> Figure:
    """Plot the first couch with and without its turn, and the paths of all wheels, from above."""
    from matplotlib.collections import LineCollection

    figure, (free, held, wheels) = panels(("May turn", "May not turn", "On wheels"), height=3.8)
    for axes, so in ((free, False), (held, True)):
        index = next((i for i, row in enumerate(rows) if row["robot"] == COUCH and row["heading_held"] is so), None)
        if index is not None:
            _trail(axes, paths[index], COUCH, COLORS[4 if rows[index]["touched"] else 0])
            overlap = 1e6 * rows[index]["max_overlap_m3"]
            axes.set_title(f"{axes.get_title()}: overlap {overlap:.3g} cm$^3$", fontsize=10)
    for k, index in enumerate(i for i, row in enumerate(rows) if row["robot"] == WHEELS):
        _trail(wheels, paths[index], WHEELS, COLORS[k // 2 % len(COLORS)])
    for axes in (free, held, wheels):
        axes.add_collection(LineCollection(walls.tolist(), colors="0.45", linewidths=0.8), autolim=False)
        axes.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    return figure


def _trail(axes: Axes, path: PlanarPath, name: str, color: str) -> None:
    """Draw outlines of a robot along its path."""
    half = 0.5 * torch.tensor(robots.load(name).body.extents[:2])
    outline = half * torch.tensor([[1.0, 1.0], [1.0, -1.0], [-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]])
    for x, y, heading in path:
        corners = outline @ so3.from_yaw(torch.tensor(heading))[:2, :2].T + torch.tensor([x, y])
        axes.plot(*corners.T.tolist(), color=color, linewidth=0.6, alpha=0.7)
    axes.plot([x for x, _, _ in path], [y for _, y, _ in path], color=color, linewidth=1.2)
