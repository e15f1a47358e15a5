"""Operator requests of a flight that is under way, taken from the session: its goal, gusts, kidnapping, and searches.

The place with its obstacles is that of the session too. A kidnapped robot is moved to a free pose far away, and gets
no notice of it. A gust is scaled to the clearance of the time step in which it pushes.
"""

from dataclasses import replace

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.field import UnknownSpace
from nerfnav.geometry import Pose
from nerfnav.navigation import GustStrength, NavigationStep, OperatorRequests, fit_gust
from nerfnav.navigation.simulator import sample_kidnap_pose
from nerfnav.planner import SafetyConfig, fits, measure_clearance
from nerfnav.robots import Motion, RigidState
from nerfnav_app.jobs.events import JobEvent, JobEvents, relay_steps
from nerfnav_app.places.derived import prepare_place
from nerfnav_app.places.ends import EndRole
from nerfnav_app.places.obstacles import find_touched
from nerfnav_app.places.place import Place
from nerfnav_app.state.flight import LARGEST_GUST
from nerfnav_app.state.job import Job
from nerfnav_app.state.session import Session

_ROOM = 0.03
"""Clearance of a kidnapped robot [m]."""
_ROOM_STEP = 0.001
"""Resolution of the room beside a robot on the ground [m]."""


def find_kidnap_pose(place: Place, truth: RigidState, generator: torch.Generator, time: float = 0.0) -> Pose | None:
    """Find a pose at which the robot fits, far from where it is, and touches no mover at that time of the flight [s];
    None where there is none."""
    planned = prepare_place(place, UnknownSpace.OCCUPIED)
    robot, body = planned.robot, planned.robot.body_with_room(_ROOM)
    movers = () if place.movers is None else place.movers.obstacles

    def is_free(state: RigidState) -> bool:
        settled = robot.settled(state, truth)
        return fits(planned.field, body, settled) and find_touched(movers, robot, settled, time) is None

    return sample_kidnap_pose(truth, planned.field.box, is_free, generator)


def make_gust(
    place: Place, truth: RigidState, action: Float[Tensor, " a"], dt: float, time: float = 0.0
) -> GustStrength:
    """Make a gust for a time step of `dt` [s] from the true state at a time of the flight [s], as strong as the
    clearance in the step allows, from movers too; of no strength where there is none."""
    planned = prepare_place(place, UnknownSpace.OCCUPIED)
    after = planned.robot.step(truth, action, dt)
    step = Motion(RigidState.stack([truth, after]), action[None], dt)
    clearance = _level_clearance(planned, step) if planned.robot.planar else _clearance(planned, step)
    if place.movers is not None:
        clearance = min(clearance, max(0.0, place.movers.least_gaps(step.states, dt, planned.robot.body, time).item()))
    return fit_gust(LARGEST_GUST, planned.robot, clearance)


def _clearance(planned: Place, motion: Motion) -> float:
    """Measure the clearance of a motion [m], at most the reach of the measurement."""
    config, body = SafetyConfig(), planned.robot.body
    _, reach, _ = config.lengths(planned.field, body)
    found = measure_clearance(planned.field, motion, body, config)
    return reach if found is None else found


def _level_clearance(planned: Place, motion: Motion) -> float:
    """Find the room beside a robot on the ground [m], to a millimetre: what it stands on is always near."""
    _, high, _ = SafetyConfig().lengths(planned.field, planned.robot.body)
    low = 0.0
    while high - low > _ROOM_STEP:
        middle = 0.5 * (low + high)
        body = planned.robot.body_with_room(middle)
        free = all(fits(planned.field, body, state) for state in (motion.states[0], motion.states[-1]))
        low, high = (middle, high) if free else (low, middle)
    return low


class SessionRequests:
    """Operator of one flight that follows the session. Used by the worker's thread alone."""

    def __init__(self, job: Job, place: Place) -> None:
        self._place, self._goal = place, job.ends.goal
        self._goal_state = job.ends.goal.state()
        self._last: NavigationStep | None = None
        self._job = self._served = job
        self._generator = torch.Generator().manual_seed(job.id)
        self._bare = place.without_obstacles().field

    def follow(self, session: Session) -> None:
        """Take the requests of the session; a goal counts once the robot is known to fit there."""
        job = session.job
        if job is None or job.id != self._job.id:
            return
        self._job = job
        if session.flight is not None and session.flight.steps:
            self._keep(session.flight.steps[-1])
        place = session.place
        if place is not None and place.without_obstacles().field is self._bare:
            self._place = place
        goal = session.ends.goal
        if goal != self._goal and session.problems.get(EndRole.GOAL, "not known yet") is None:
            self._goal, self._goal_state = goal, goal.state()

    def surroundings(self) -> Place:
        """The place with its obstacles as they stand now."""
        return self._place

    def watch(self, flight: JobEvents) -> JobEvents:
        """Relay the events of the flight, and note its last time step: the session hears of it later."""
        return relay_steps(flight, self._note)

    def _note(self, event: JobEvent) -> tuple[JobEvent]:
        if isinstance(event, NavigationStep):
            self._keep(event)
        return (event,)

    def _keep(self, step: NavigationStep) -> None:
        if self._last is None or step.index > self._last.index:
            self._last = step

    def take(self) -> OperatorRequests:
        """Take the requests for the next time step; a gust blows once for each time that it was requested."""
        job, served, last = self._job, self._served, self._last
        if last is None:  # the flight has not begun: what is requested waits
            return OperatorRequests(goal=self._goal_state)
        blows, kidnaps = served.gusts < job.gusts, served.kidnaps < job.kidnaps
        self._served = replace(job, gusts=served.gusts + blows)
        return OperatorRequests(
            goal=self._goal_state,
            gust=make_gust(self._place, last.truth, last.plan.actions[0], last.plan.dt, last.time) if blows else None,
            kidnap_pose=find_kidnap_pose(self._place, last.truth, self._generator, last.time) if kidnaps else None,
            search=served.searches < job.searches,
        )
