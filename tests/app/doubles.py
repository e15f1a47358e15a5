"""Small stand-ins for what the app's tests need: a place of three balls, and jobs whose steps are made by hand."""

from collections.abc import Generator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import torch

from nerfnav.estimator.core.belief import Belief
from nerfnav.estimator.core.filter_step import FilterStep
from nerfnav.field.core.info import FieldInfo
from nerfnav.field.models.analytic import BallsField
from nerfnav.field.models.voxel import DENSITY_SCALE, EMPTY_RAW, VoxelField
from nerfnav.geometry.box import Box
from nerfnav.geometry.grid import node_positions, shape_for
from nerfnav.navigation.episode import EpisodeOutcome, NavigationStep
from nerfnav.planner.steps import PlanCost, PlanOutcome, PlanStep
from nerfnav.planner.trajectory import Route, Trajectory
from nerfnav.robots.quadrotor import Quadrotor
from nerfnav.robots.state import Motion, RigidState
from nerfnav_app.jobs.events import JobEvents, JobResult, PlaceOpened, Progress
from nerfnav_app.places.ends import End, Ends
from nerfnav_app.places.place import Place
from nerfnav_app.queries.clearance import Clearance, ClearanceQuery
from nerfnav_app.queries.end_fit import EndFit, EndFitQuery
from nerfnav_app.queries.experiments import Experiments, ExperimentsQuery
from nerfnav_app.queries.first_ends import FirstEnds, FirstEndsQuery
from nerfnav_app.queries.following_plan import FollowingPlanQuery, SessionPlan
from nerfnav_app.queries.place_list import PlaceListQuery
from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.queries.robot_view import RobotViewQuery
from nerfnav_app.queries.run_list import RunListQuery
from nerfnav_app.queries.stored_run import StoredRunQuery
from nerfnav_app.state.actions import RunChanged
from nerfnav_app.state.job import Job, JobKind
from nerfnav_app.state.runs import RunChange
from nerfnav_app.state.session import Session
from nerfnav_app.storage.run_store import RunStore
from nerfnav_app.worker.backend import NavigationBackend

_BOX = Box.of((-1, -1, 0), (1, 1, 0.8))


def balls_place(box: Box = _BOX) -> Place:
    """A place without ground truth: three balls in a box, of 2 m where nothing is said."""
    centers = torch.tensor([[0.0, 0.0, 0.3], [0.5, 0.4, 0.2], [-0.4, -0.5, 0.25]])
    balls = BallsField(box, centers, torch.tensor([0.2, 0.15, 0.15]))
    return Place("balls", voxels_of(balls, spacing=0.04), None, Quadrotor())


def voxels_of(field: BallsField, spacing: float) -> VoxelField:
    """The field on a grid of nodes about `spacing` [m] apart."""
    points = node_positions(field.box, shape_for(field.box, spacing))
    raw = torch.expm1((field.density(points) / DENSITY_SCALE).clamp_min(1e-9)).log().clamp_min(EMPTY_RAW)
    values = torch.cat([raw[..., None], field.radiance(points, points).clamp(0, 1)], -1)
    return VoxelField(field.box, values, field.background, FieldInfo(source="balls", noise_std=0.05))


def straight_motion(ends: Any, steps: int = 8, dt: float = 0.1) -> Motion:
    """A motion through evenly spaced level states, whose actions mean nothing."""
    start, goal = ends.start.state(), ends.goal.state()
    shares = torch.linspace(0, 1, steps + 1)[:, None]
    rest = torch.zeros(steps + 1, 3)
    states = RigidState(
        start.position + shares * (goal.position - start.position), rest, start.rotation.expand(steps + 1, 3, 3), rest
    )
    return Motion(states, torch.zeros(steps, 4), dt)


def plan_step(ends: Any, iteration: int, outcome: PlanOutcome | None = None) -> PlanStep:
    """One iteration of a plan along the straight line; with an outcome, its result."""
    trajectory = Trajectory(torch.zeros(1), Route(ends.start.state(), ends.goal.state(), 8, 0.1))
    cost = PlanCost(collision=1 / (1 + iteration), control=2.0, limits=0.0)
    step = PlanStep(iteration, trajectory, straight_motion(ends), cost)
    return step if outcome is None else step.end(outcome)


def flight_step(ends: Any, index: int, outcome: EpisodeOutcome | None = None) -> NavigationStep:
    """One time step of a flight along the straight line, the belief a centimetre beside the truth."""
    motion = straight_motion(ends)
    truth = motion.states[min(index, 8)]
    covariance = torch.diag(torch.tensor([4e-4, 1e-4, 1e-4] + 9 * [1e-4]))
    belief = Belief(truth.retract(torch.tensor([0.01] + 11 * [0.0])), covariance)
    image = torch.full((20, 30, 3), 40 * index % 255, dtype=torch.uint8)
    return NavigationStep(
        index=index,
        time=0.1 * index,
        action=torch.zeros(4) if index else None,
        truth=truth,
        belief=belief,
        image=image if index else None,
        update=None,
        plan=motion,
        touched=False,
        filter_ms=1.0,
        replan_ms=2.0,
        outcome=outcome,
    )


def filter_step(ends: Any, iteration: int) -> FilterStep:
    """One iteration of a filter that believes to be at the start."""
    pixels, residual = torch.zeros(4, 2, dtype=torch.int64), torch.zeros(4)
    return FilterStep(iteration, ends.start.state(), 1.0, 0.1, pixels, residual)


@dataclass
class ScriptedWork:
    """Work whose jobs yield what `scripts` has for their kind."""

    scripts: dict[JobKind, list[Any]] = field(default_factory=dict)
    asked: list[Query[Any]] = field(default_factory=list)
    closed: list[int] = field(default_factory=list)
    runs: RunStore | None = None

    def begin(self, session: Session, job: Job) -> JobEvents:
        """Yield the script; an exception in it is raised, a result returned."""
        opening = [Progress("opening", 0.5), PlaceOpened(balls_place()), JobResult()]
        script = self.scripts.get(job.kind, opening if job.kind is JobKind.OPEN else [])
        try:
            for entry in script:
                event: Any = entry(job) if callable(entry) else entry
                if isinstance(event, Exception):
                    raise event
                if isinstance(event, JobResult):
                    return event
                yield event
            return JobResult()
        finally:
            self.closed.append(job.id)

    def follow(self, session: Session) -> None:
        """Scripts go their way."""

    def steps(self, place: Place, query: Query[Any]) -> Generator[None, None, Any]:
        """One step each."""
        yield from ()
        return self.answer(place, query)

    def answer(self, place: Place, query: Query[Any]) -> Any:
        """All ends are free, all views are grey, and the stored runs are as they are."""
        if isinstance(query, RunListQuery | StoredRunQuery | PlaceListQuery):
            return query.answer(Resources(place, self.runs))
        if isinstance(query, ExperimentsQuery):
            return Experiments((("planners", "which is best"),))
        if isinstance(query, FirstEndsQuery):
            return FirstEnds(Ends(End((-0.7, 0.0, 0.4)), End((0.7, 0.0, 0.4))))
        if isinstance(query, ClearanceQuery):
            return Clearance(np.zeros((3, len(query.shown.motion.actions))))
        self.asked.append(query)
        if isinstance(query, EndFitQuery):
            return EndFit(None)
        if isinstance(query, FollowingPlanQuery):
            return SessionPlan(refusal="nobody plans here")
        assert isinstance(query, RobotViewQuery), f"nobody has scripted an answer to {query}"
        return tuple(np.full((20, 20, 3), 90, np.uint8) for _ in query.states)

    def change(self, change: RunChange) -> RunChanged:
        """As the backend does."""
        return NavigationBackend(runs=self.runs).change(change)
