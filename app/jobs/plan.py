"""Plan: from a start and a goal to a trajectory through the field, judged on the mesh."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from app.jobs.events import JobEvents, JobFinished, JobStarted, Progress
from app.jobs.stopwatch import Stopwatch
from app.jobs.validation import require_positive, require_probability
from app.places.ends import Ends
from app.places.place import Place, occupancy_of, planning_place
from app.storage.output_files import json_line, prepare_folder, write_text
from nerfnav.errors import InvalidInputError
from nerfnav.export.tables import csv_text, json_text, motion_table
from nerfnav.field.unknown import Unknown
from nerfnav.planner import planners
from nerfnav.planner.chance import within_chance
from nerfnav.planner.duration import shortest_plan
from nerfnav.planner.fast import FastPlanConfig
from nerfnav.planner.occupancy import OccupancyMap
from nerfnav.planner.planner import Planner, PlannerConfig
from nerfnav.planner.problem import PlanProblem
from nerfnav.planner.route import Route
from nerfnav.planner.safety import Safety, safety_of
from nerfnav.planner.steps import GOOD, PlanCost, PlanOutcome, PlanStep
from nerfnav.robots.limits import limit_uses
from nerfnav.robots.state import Motion


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
    config: PlannerConfig | None = None
    """Its settings; None: its own."""
    again: PlannerConfig | None = None
    """Its settings when the plan is redone at each step of a flight; None: the above with room for what pushes it."""
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
    def settings(self) -> PlannerConfig:
        """How the planner works. Raises NerfnavError for an unknown planner, or settings of another one."""
        own = planners.load(self.planner).config()
        for given in (self.config, self.again):
            if given is not None and type(given) is not type(own):
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
    entry, place = planners.load(request.planner), planning_place(place, request.unknown)
    out = None if request.out is None else prepare_folder(request.out)
    yield JobStarted("plan")
    yield Progress("finding a way", 0.0)
    clock, last = Stopwatch(), None
    with clock.running():
        occupancy = occupancy_of(place, request.settings.occupancy)
    finder = entry.planner(place.field, place.robot, request.settings, occupancy=occupancy)
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
        steps = shortest_plan(lambda count: finder.plan(Route(start, goal, count, dt)), place.robot)
    else:
        steps = finder.plan(Route(start, goal, request.steps, dt))
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
        "cost": _cost(step.cost),
        "collision_probability_bound": safety.bound,
        "mesh_overlap_m3": overlap_m3,
        "max_thrust_n": _max_thrust_n(place, motion),
        "max_body_rate": motion.states.body_rate.norm(dim=-1).max().item(),
        "duration_s": motion.actions.shape[-2] * motion.dt,
        "limits": _limits(place, motion),
        "safety": _safety(safety, step, max_collision),
    }


def _cost(cost: PlanCost) -> dict[str, Any]:
    """The terms of J, and of those that were added to Eq. 2 the time that each takes."""
    told: dict[str, Any] = {"collision": cost.collision, "control": cost.control, "total": cost.total}
    if cost.added:
        told["added"] = {term.name: {"value": term.value, "ms": term.ms} for term in cost.added}
    return told


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
