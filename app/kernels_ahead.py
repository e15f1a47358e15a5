"""Compile the kernels of plans and flights; `python -m nerfnav_app.kernels_ahead` does so once for each machine.

The app begins it (system.py) on a machine that has not compiled them, while the user looks at the page. The page's own
process compiles too (`warm_up` in jobs/open/opening.py, and the first plan): this one starts with what a first plan
needs last, so that two cores compile different kernels, and each waits for what the other one compiles
(nerfnav/core/jit.py).
"""

import os
import sys
import warnings
from contextlib import suppress

import torch

from nerfnav.core.kernel_cache import KernelCacheWarning, can_be_kept, complete_mark
from nerfnav.core.steps import run_steps
from nerfnav.planner import FastPlanConfig, PlanProblem, replan_from
from nerfnav_app.jobs.fly import fly
from nerfnav_app.jobs.fly.request import FlyRequest
from nerfnav_app.jobs.plan import plan as plan_job
from nerfnav_app.jobs.plan.plan import PlanRequest
from nerfnav_app.places.ends import Ends
from nerfnav_app.places.place import open_place
from nerfnav_app.system import TORCH_THREADS

_NICENESS = 5
"""The page goes first."""


def compile_kernels() -> None:
    """Fly and plan in Stonehenge, so that each kernel on the way is compiled, and mark that all are there."""
    place = open_place("stonehenge")
    task = place.tasks[0]
    problem = PlanProblem(place.field, place.robot, task.start_state, task.goal_state)
    shares = torch.linspace(0.0, 1.0, problem.steps + 1)[:, None]
    straight = torch.lerp(problem.start.position, problem.goal.position, shares)
    guess = problem.trajectory_through(torch.cat([straight, torch.zeros_like(shares)], 1))
    plan = run_steps(replan_from(problem, guess.motion(place.robot), 0, FastPlanConfig())).motion
    route = PlanRequest(Ends.of_task(task))
    run_steps(fly.run(FlyRequest(route, plan), place))  # begins with the filter, for it has a plan
    run_steps(plan_job.run(route, place))
    complete_mark().touch()


if __name__ == "__main__":
    with suppress(AttributeError):  # Windows has none
        os.nice(_NICENESS)
    torch.set_num_threads(TORCH_THREADS)
    warnings.simplefilter("error", KernelCacheWarning)
    try:
        can_be_kept()
    except KernelCacheWarning as warning:
        sys.exit(f"nerfnav: {warning}")
    compile_kernels()
