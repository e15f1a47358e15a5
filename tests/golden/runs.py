"""Plans and flights in the golden room, computed step by step: what is compared of each, and how closely.

They are computed in a process of their own (`python -m tests.golden.runs` prints them as JSON), in which libraries of
linear algebra have one thread: with two they round otherwise, and a plan that counts risk ends elsewhere then.

The rule: on the processor and with the libraries that wrote the golden files (`arithmetic`), the same program computes
the same bits, and all iterations and all steps are compared within `TIGHT`; no looser tolerance could tell a small
change of behaviour from chance. Elsewhere, rounding differs from the first operation on, and searches and flights are
chaotic. There, the first `EARLY` iterations of a plan and the start of a flight are compared within `NEAR`, and of what
follows only how it ends: the outcome, J within `J_SHARE`, and where the robot is within `APART_M`.
"""

import hashlib
import json
import math
import os
import platform
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import replace
from importlib.metadata import version
from pathlib import Path
from typing import Any

import torch

from tests.golden import product as p

THREADS = "NERFNAV_GOLDEN_THREADS"
"""Environment variable with another number of threads than one, to see how much the rule for other machines allows."""
TIGHT, NEAR = (1e-6, 1e-9), (1e-3, 1e-4)
"""Relative and absolute tolerance of numbers: where the arithmetic is the same, and where it is not."""
EARLY, J_SHARE, APART_M = 6, 0.05, 0.15
"""Iterations that are compared where the arithmetic differs; share by which the last J may differ; how far a robot may
be from where it was at the same time, and a waypoint from its golden one [m]."""
ROOM = Path(__file__).with_name("data") / "fields" / "room.npz"
"""The field of the golden room."""
_FROM_LIBRARIES = ("torch", "numpy", "numba", "scipy")
_ENDS = p.Ends(p.End((-0.65, -0.6, 0.4), 0.4), p.End((0.6, 0.65, 0.55), 1.2))
_GROUND = p.Ends(p.End((-0.7, 0.1, 0.22), 0.0), p.End((0.25, 0.72, 0.22), 0.6))
_SHORT = p.Ends(p.End((-0.65, -0.6, 0.4), 0.4), p.End((0.05, -0.55, 0.5), 0.8))


def room_for(robot: str, field: Any) -> p.Place:
    """The golden room as a place, without a ground truth."""
    return p.Place("room", field, None, p.robots.load(robot))


def plan_requests() -> dict[str, tuple[str, p.PlanRequest]]:
    """The golden plans: the robot and the request of each, with the cost of its settings alone, as --paper-cost has."""
    return {name: (robot, _own_cost(request)) for name, (robot, request) in _plan_requests().items()}


def _own_cost(request: p.PlanRequest) -> p.PlanRequest:
    return replace(request, paper_cost=True)


def _plan_requests() -> dict[str, tuple[str, p.PlanRequest]]:
    paper, careful = p.PlanConfig(iterations=12), _with_risk(p.FastPlanConfig())
    return {
        "fast quadrotor": ("quadrotor", p.PlanRequest(_ENDS)),
        "fast quadrotor with risk": ("quadrotor", p.PlanRequest(_ENDS, steps=16, config=careful)),
        "fast couch": ("couch", p.PlanRequest(_GROUND, steps=15)),
        "fast diffdrive": ("diffdrive", p.PlanRequest(_GROUND, steps=18)),
        "fast quadrotor in the shortest time": ("quadrotor", p.PlanRequest(_SHORT, shortest=True)),
        "paper quadrotor": ("quadrotor", p.PlanRequest(_ENDS, planner="paper", config=paper)),
        "minsnap quadrotor": ("quadrotor", p.PlanRequest(_ENDS, planner="minsnap")),
    }


def plan_of(name: str, field: Any) -> dict[str, Any]:
    """A golden plan: each iteration's J and its terms, then the last motion and the numbers that are printed."""
    robot, request = plan_requests()[name]
    torch.set_num_threads(1)
    steps, result = p.finished(p.plan(request, room_for(robot, field)), (p.PlanStep,))
    last = steps[-1]
    summary = {key: value for key, value in result.summary.items() if key != "wall_s"}  # a time that was measured
    return plain({
        "iterations": [_iteration(step) for step in steps],
        "free": last.trajectory.free,
        "motion": _motion(last.motion),
        "summary": summary,
    })


def flight_requests() -> dict[str, tuple[str, p.FlyRequest]]:
    """The golden flights: the robot and the request of each."""
    quick = p.FilterConfig(descent=p.DescentConfig(iterations=4), process_noise=p.StateNoise.isotropic(0.02))
    paper = p.PlanConfig(iterations=8)
    again = p.PlanConfig(iterations=3)
    start = p.Pose(p.so3.from_yaw(torch.tensor(2.4)), torch.tensor([0.55, -0.45, 0.45]))

    def sample_kidnap_pose(step: int) -> p.OperatorRequests:
        return p.OperatorRequests(kidnap_pose=start) if step == 3 else p.OperatorRequests()

    def disturbed(step: int) -> p.OperatorRequests:
        return p.OperatorRequests(gust=p.StateNoise(0.05, 0.3, 0.05, 0.3)) if step == 4 else p.OperatorRequests()

    def route(**changes: Any) -> p.PlanRequest:
        return p.PlanRequest(**{"ends": _SHORT, "steps": 10} | changes)

    return {
        "fast filter in the physical world": ("quadrotor", p.FlyRequest(
            route(steps=14, world="physical"), seed=1, operator=p.ordered(disturbed),
        )),
        "paper planner and filter": ("quadrotor", p.FlyRequest(
            route(
                planner="paper", config=paper, again=again, flight=p.NavigateConfig(filter=quick, timeout_factor=0.7)
            ), estimator="paper", seed=2,
        )),
        "open loop": ("quadrotor", p.FlyRequest(route(), open_loop=True, seed=3)),
        "carried away and found again": ("quadrotor", p.FlyRequest(
            route(flight=p.NavigateConfig(timeout_factor=1.5)), seed=4, operator=p.ordered(sample_kidnap_pose),
        )),
        "wheels": ("diffdrive", p.FlyRequest(route(ends=_GROUND, steps=18), seed=5)),
    }  # fmt: skip


def flight_of(name: str, field: Any) -> dict[str, Any]:
    """A golden flight: what is true and believed at each step, what the plan leads to, and the numbers at the end."""
    robot, request = flight_requests()[name]
    torch.set_num_threads(1)
    steps, result = p.finished(p.fly(request, room_for(robot, field)), (p.NavigationStep,))
    summary = {key: value for key, value in result.summary.items() if key != "timing_ms"}  # times that were measured
    return plain({"steps": [_step(step) for step in steps], "summary": without_later_numbers(summary)})


def without_later_numbers(metrics: Mapping[str, Any]) -> dict[str, Any]:
    """Drop the numbers of a flight that there were not when the golden files were written."""
    before = {name: value for name, value in metrics.items() if name not in ("silent", "transitions")}
    counts = {name: count for name, count in metrics["recoveries"].items() if name != "landed"}
    return before | {"recoveries": counts}


def plain(value: Any) -> Any:
    """The same as JSON gives it back, numbers that are not finite as words."""
    value = p.told_of(value)
    if isinstance(value, dict):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, list):
        return [plain(entry) for entry in value]
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value


def differences(golden: Any, now: Any, tolerance: tuple[float, float], where: str = "") -> list[str]:
    """Everything in which `now` differs from what is golden, a line each; names that were added differ, too."""
    if isinstance(golden, Mapping) and isinstance(now, Mapping):
        missing = [f"{where}.{key}: on one side only" for key in golden.keys() ^ now.keys()]
        shared = [key for key in golden if key in now]
        return missing + [
            line for key in shared for line in differences(golden[key], now[key], tolerance, f"{where}.{key}")
        ]
    if isinstance(golden, list) and isinstance(now, list):
        if len(golden) != len(now):
            return [f"{where}: {len(golden)} entries were golden, not {len(now)}"]
        return [
            line
            for index, (one, other) in enumerate(zip(golden, now, strict=True))
            for line in differences(one, other, tolerance, f"{where}[{index}]")
        ]
    relative, absolute = tolerance
    numbers = all(isinstance(value, int | float) and not isinstance(value, bool) for value in (golden, now))
    same = math.isclose(golden, now, rel_tol=relative, abs_tol=absolute) if numbers else golden == now
    same = same and isinstance(golden, bool) == isinstance(now, bool)
    return [] if same else [f"{where}: {golden!r} was golden, not {now!r}"]


def arithmetic() -> dict[str, str]:
    """What decides how numbers are rounded: libraries, processor, threads."""
    cpu = Path("/proc/cpuinfo")
    lines = cpu.read_text().splitlines() if cpu.is_file() else [platform.processor()]
    models = sorted({line for line in lines if line.startswith(("model name", "flags", "CPU part", "Features"))})
    machine = hashlib.sha256("".join([platform.machine(), *models]).encode()).hexdigest()[:16]
    versions = {name: version(name) for name in _FROM_LIBRARIES}
    return {"machine": machine, "threads": os.environ.get(THREADS, "1"), **versions}


def computed() -> dict[str, dict[str, Any]]:
    """All plans and flights as this program computes them now, in a process of their own."""
    count = os.environ.get(THREADS, "1")
    libraries = {f"{name}_NUM_THREADS": count for name in ("OMP", "OPENBLAS", "MKL", "NUMBA")}
    done = subprocess.run(
        [sys.executable, "-m", "tests.golden.runs"],
        env={**os.environ, **libraries}, cwd=Path(__file__).parents[2], capture_output=True, text=True,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout.splitlines()[-1])


def differences_of_plans(golden: dict[str, Any], now: dict[str, Any], same_arithmetic: bool) -> list[str]:
    """Everything in which a plan differs from the golden one, by the rule of this module."""
    if same_arithmetic:
        return differences(golden, now, TIGHT)
    first = slice(0, EARLY)
    found = differences(golden["iterations"][first], now["iterations"][first], NEAR)
    last = [{key: plan["iterations"][-1][key] for key in ("total", "outcome")} for plan in (golden, now)]
    ends = [{"motion": plan["motion"]["position"], "keys": sorted(plan["summary"])} for plan in (golden, now)]
    return found + differences(*last, (J_SHARE, 0.0)) + differences(*ends, (0.0, APART_M))


def differences_of_flights(golden: dict[str, Any], now: dict[str, Any], same_arithmetic: bool) -> list[str]:
    """Everything in which a flight differs from the golden one, by the rule of this module."""
    if same_arithmetic:
        return differences(golden, now, TIGHT)
    begun = [{key: flight["steps"][0][key] for key in ("truth", "mean", "deviations")} for flight in (golden, now)]
    both = min(len(golden["steps"]), len(now["steps"]))
    ways = [[step["truth"]["position"] for step in flight["steps"][:both]] for flight in (golden, now)]
    ends = [{"outcome": flight["summary"]["outcome"], "keys": sorted(flight["summary"])} for flight in (golden, now)]
    return differences(*begun, NEAR) + differences(*ways, (0.0, APART_M)) + differences(*ends, TIGHT)


def _with_risk(config: p.FastPlanConfig) -> p.FastPlanConfig:
    return type(config)(weights=type(config.weights)(risk=50.0))


def _iteration(step: p.PlanStep) -> dict[str, Any]:
    cost = step.cost
    return {
        "iteration": step.iteration,
        "start": step.start_index,
        "collision": cost.collision,
        "control": cost.control,
        "limits": cost.limits,
        "risk": cost.risk,
        "added": {term.name: term.value for term in cost.added},
        "total": cost.total,
        "outcome": step.outcome.name if isinstance(step, p.PlanResult) else None,
        "restart": None if step.restart is None else step.restart.name,
    }


def _motion(motion: p.Motion) -> dict[str, Any]:
    return {**_state(motion.states), "actions": motion.actions, "dt": motion.dt}


def _state(state: p.RigidState) -> dict[str, Any]:
    return {
        "position": state.position,
        "velocity": state.velocity,
        "rotation": state.rotation,
        "body_rate": state.body_rate,
    }


def _step(step: p.NavigationStep) -> dict[str, Any]:
    return {
        "index": step.index,
        "time": step.time,
        "action": step.action,
        "truth": _state(step.truth),
        "mean": _state(step.belief.mean),
        "deviations": step.belief.covariance.diagonal().clamp_min(0).sqrt(),
        "covariance_trace": step.belief.covariance.diagonal().sum(),
        "update": None if step.update is None else step.update.outcome,
        "plan_steps": len(step.plan.actions),
        "plan_end": step.plan.states.position[-1],
        "touched": step.touched,
        "recovery": step.recovery,
        "restart": step.restart,
        "backup": step.fallback is not None,
        "hits_expected": step.hits_expected,
        "late": step.late,
        "outcome": step.outcome,
    }


if __name__ == "__main__":
    room = p.load_field(ROOM)
    with p.usual_noise():
        plans = {name: plan_of(name, room) for name in plan_requests()}
    print(json.dumps({"plans": plans, "flights": {name: flight_of(name, room) for name in flight_requests()}}))
