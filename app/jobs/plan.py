"""Plan: from a start and a goal to a trajectory through the field, judged on the mesh."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from app.ends import Ends
from app.events import JobEvents, JobFinished, JobStarted, Progress
from app.jobs.checks import require_positive, require_probability
from app.jobs.clock import Stopwatch
from app.jobs.outputs import json_line, prepare_folder, write_text
from app.place import Place, occupancy_of, planning_place
from app.registry import PLAN_CONFIGS, PLANNERS, named
from nerfnav.errors import InvalidInputError
from nerfnav.export.tables import csv_text, json_text, motion_table
from nerfnav.field.unknown import Unknown
from nerfnav.navigation.planners import Planner
from nerfnav.planner.chance import within_chance
from nerfnav.planner.duration import shortest_plan
from nerfnav.planner.fast import FastPlanConfig
from nerfnav.planner.minsnap import MinSnapConfig
from nerfnav.planner.occupancy import OccupancyMap
from nerfnav.planner.optimize import PlanConfig
from nerfnav.planner.problem import PlanProblem
from nerfnav.planner.rrt import RRTConfig
from nerfnav.planner.safety import Safety, safety_of
from nerfnav.planner.steps import GOOD, PlanOutcome, PlanStep
from nerfnav.robots.limits import limit_uses
from nerfnav.robots.state import Motion

PlanSettings = PlanConfig | FastPlanConfig | MinSnapConfig | RRTConfig


@dataclass(frozen=True)
class PlanRequest:
    """What to plan."""

    ends: Ends
    """Where the robot is, and where it shall come to rest."""
    steps: int = 20
    """Number of time steps."""
    dt: float = 0.1
    """Length of a step [s]."""
    planner: str = "fast"
    """Name of the planner."""
    config: PlanSettings | None = None
    """Its settings; None: its own."""
    shortest: bool = False
    """Whether to find the shortest duration that keeps the robot's limits, in place of `steps`."""
    max_collision: float | None = None
    """Largest bound on the probability of a collision that is accepted; None accepts any."""
    unknown: Unknown = Unknown.OCCUPIED
    """What space that no camera ever saw into is taken for."""
    out: Path | None = None
    """Folder for trajectory.csv, trajectory.json and plan.json; None writes nothing."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for numbers that no plan can have."""
        require_positive(steps=self.steps, dt=self.dt, iterations=self.settings.iterations)
        require_probability(max_collision=self.max_collision)

    @property
    def settings(self) -> PlanSettings:
        """How the planner works. Raises NerfnavError for an unknown planner, or settings of another one."""
        own = named("planner", self.planner, PLAN_CONFIGS)()
        if self.config is not None and type(self.config) is not type(own):
            raise InvalidInputError(f"these settings are not those of the planner {self.planner!r}: leave them out")
        return own if self.config is None else self.config

    def lasting(self, seconds: float) -> "PlanRequest":
        """The same in a given time [s], cut into whole steps of about dt. Raises InvalidInputError for none."""
        require_positive(duration=seconds)
        steps = max(1, round(seconds / self.dt))
        return replace(self, steps=steps, dt=seconds / steps)


def run(request: PlanRequest, place: Place) -> JobEvents:
    """Yield every iteration of the planner, then the numbers of the last one and what was written.

    Raises NerfnavError where the request cannot be worked with.
    """
    planner, place = named("planner", request.planner, PLANNERS), planning_place(place, request.unknown)
    out = None if request.out is None else prepare_folder(request.out)
    yield JobStarted("plan")
    yield Progress("finding a way", 0.0)
    clock, last = Stopwatch(), None
    with clock.running():
        occupancy = occupancy_of(place, request.settings.occupancy)
    finder = planner(place.field, place.robot, first=request.settings, occupancy=occupancy)
    for step in clock.time(_steps(request, place, finder, occupancy)):
        last = step
        yield step
        yield Progress("optimising", min(1.0, (step.iteration + 1) / request.settings.iterations))
    assert last is not None, "a planner yields at least one step"
    yield Progress("judging", 1.0)
    overlap = mesh_overlap_m3(place, last.motion)
    if overlap and last.outcome in GOOD:
        last = replace(last, outcome=PlanOutcome.TOUCHES_MESH)
        yield last
    summary = summary_of(last, place, clock.seconds, overlap, request.max_collision)
    yield JobFinished("plan", summary, () if out is None else save(out, last.motion, place, summary))


def _steps(
    request: PlanRequest, place: Place, finder: Planner, occupancy: OccupancyMap
) -> Iterator[PlanStep]:
    """Plan as often as the request asks for: for the duration, then for the bound on collisions."""
    start, goal, dt, last = request.ends.start.state(), request.ends.goal.state(), request.dt, None
    if request.shortest:
        steps = shortest_plan(lambda count: finder.plan(start, goal, count, dt), place.robot)
    else:
        steps = finder.plan(start, goal, request.steps, dt)
    for last in steps:
        if last.outcome is None:
            yield last
    assert last is not None, "a planner yields at least one step"
    if request.max_collision is None:
        yield last
        return
    problem = PlanProblem(place.field, place.robot, start, goal, last.trajectory.steps, dt)
    careful = FastPlanConfig(weights=request.settings.weights, occupancy=request.settings.occupancy)
    yield from within_chance(problem, last, careful, request.max_collision, occupancy)


def summary_of(
    step: PlanStep, place: Place, wall_s: float, overlap_m3: float | None, max_collision: float | None = None
) -> dict[str, Any]:
    """What `plan --json` prints, for the last step of a planner."""
    motion = step.motion
    safety = safety_of(place.field, motion, place.robot.body)
    return {
        "outcome": step.outcome.name.lower() if step.outcome else None,
        "iterations": step.iteration + 1,
        "wall_s": wall_s,
        "cost": {
            "collision": step.cost.collision,
            "control": step.cost.control,
            "total": step.cost.total,
        },
        "collision_probability_bound": safety.bound,
        "mesh_overlap_m3": overlap_m3,
        "max_thrust_n": _max_thrust_n(place, motion),
        "max_body_rate": motion.states.body_rate.norm(dim=-1).max().item(),
        "duration_s": motion.actions.shape[-2] * motion.dt,
        "limits": _limits(place, motion),
        "safety": _safety(safety, step, max_collision),
    }


def _limits(place: Place, motion: Motion) -> dict[str, dict[str, Any]]:
    """What the motion asks of each of the robot's bounds."""
    return {
        use.name: {
            "least": use.least, "most": use.most, "lower": use.lower, "upper": use.upper, "unit": use.unit,
            "violated": use.violated,
        }
        for use in limit_uses(place.robot, motion)
    }  # fmt: skip


def _safety(safety: Safety, step: PlanStep, max_collision: float | None) -> dict[str, Any]:
    """What the field believes that the plan risks, and by how much this is more than was asked for."""
    told: dict[str, Any] = {
        "bound": safety.bound,
        "bound_per_step_max": safety.per_step.max().item(),
        "min_clearance_m": safety.min_clearance_m,
        "worst_step": safety.worst_step,
    }
    if step.outcome is PlanOutcome.TOO_RISKY and max_collision is not None:
        told["missed_by"] = safety.bound - max_collision
    return told


def mesh_overlap_m3(place: Place, motion: Motion) -> float | None:
    """Largest overlap of body and mesh over the poses between the waypoints [m^3]; None without a mesh."""
    if place.scene is None:
        return None
    from nerfnav.world.contact import judge  # slow to import, and people see the place before

    return judge(place.scene, place.robot.body, motion.states).max_overlap_m3


def save(folder: Path, motion: Motion, place: Place, summary: dict[str, Any]) -> tuple[Path, ...]:
    """Write a plan's three files into `folder`."""
    table = motion_table(motion, place.robot.action_names, place.robot.name)
    return (
        write_text(folder / "trajectory.csv", csv_text(table)),
        write_text(folder / "trajectory.json", json_text(table)),
        write_text(folder / "plan.json", json_line(summary) + "\n"),
    )


def _max_thrust_n(place: Place, motion: Motion) -> float | None:
    """The largest total thrust; None for a robot whose actions are not thrusts."""
    if "thrust_n" not in place.robot.action_names:
        return None
    return motion.actions[..., place.robot.action_names.index("thrust_n")].max().item()
