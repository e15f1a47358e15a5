"""Drives of robots on the ground: the trials of each task."""

from dataclasses import dataclass, replace

from nerfnav.experiments.ground_results import WHEELS
from nerfnav.world import Task


@dataclass(frozen=True)
class Drive:
    """One trial."""

    task: Task
    """From where to where, and with which robot."""
    held: bool = False
    """Whether the heading must stay that of the start."""


def drives_of(task: Task) -> list[Drive]:
    """The trials of a task: a heading can only be held where start and goal have the same."""
    if task.robot == WHEELS:
        return [Drive(task), Drive(_back(task))]
    return [Drive(task, held) for held in ((False, True) if task.start_yaw == task.goal_yaw else (False,))]


def _back(task: Task) -> Task:
    """The way back, in reverse gear."""
    return replace(
        task, name=f"{task.name}, and back", start=task.goal, goal=task.start, start_yaw=task.goal_yaw,
        goal_yaw=task.start_yaw,
    )  # fmt: skip
