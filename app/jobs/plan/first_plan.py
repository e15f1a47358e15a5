"""Time the first plan of this process: the part of app/benchmarks/cold.py that runs in the new process."""

import time


def first_plan(place: str) -> dict[str, float]:
    """Times [s] of this process, which must be new: imports, opening a place, the plan of its first task with its map.

    The processor time of the plan is among them: it does not contain what else the machine does.
    """
    began = time.perf_counter()
    from nerfnav.core.steps import run_steps
    from nerfnav.planner import FastPlanConfig, PlanProblem, plan_fast
    from nerfnav_app.places.derived import build_occupancy
    from nerfnav_app.places.place import open_place

    imported = time.perf_counter()
    opened = open_place(place)
    ready, worked = time.perf_counter(), time.process_time()
    task, config = opened.tasks[0], FastPlanConfig()
    problem = PlanProblem(opened.field, opened.robot, task.start_state, task.goal_state)
    occupancy = build_occupancy(opened, config.occupancy, problem.start.position[2].item())
    run_steps(plan_fast(problem, config, occupancy))
    return {
        "import_s": imported - began, "open_s": ready - imported, "first_plan_s": time.perf_counter() - ready,
        "first_plan_cpu_s": time.process_time() - worked,
    }  # fmt: skip
