"""Query for the clearance of the motion that is shown, step by step: of the plan, or of that in flight."""

from collections.abc import Generator, Iterator
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
import torch

from nerfnav.estimator import FilterConfig
from nerfnav.field import UnknownSpace
from nerfnav.navigation import NavigateConfig, WorldName
from nerfnav.planner import OccupancyConfig, PathDensity, SafetyConfig, count_movers, measure_clearance
from nerfnav.planner.risk.tracking_error import tracking_deviations
from nerfnav.robots import Motion, NoiseModel, Robot, StateNoise
from nerfnav_app.places.derived import expect_noise_in, planning_robot, prepare_place
from nerfnav_app.queries.query import LongQuery, Resources
from nerfnav_app.state.plan import PlanRecord
from nerfnav_app.state.session import Session

_STRETCHES = 5
"""Parts of a motion whose clearance is measured in flight."""
_PAUSE = 19.0
"""In flight the next step waits for the answer: it takes a twentieth of the time."""


@dataclass(frozen=True)
class NoiseContext:
    """Noise for which a plan keeps room, and the world that it comes from."""

    noise: StateNoise
    """Disturbance at each time step."""
    world: WorldName
    """World of the flight."""


@dataclass(frozen=True, eq=False)
class ShownMotion:
    """Motion that the page shows as the plan."""

    motion: Motion
    """The plan, or what is left of it in flight."""
    begins_s: float = 0.0
    """Time of its first state in the flight [s]."""
    flown: bool = False
    """True for the plan that a flight follows at the time that is shown."""


@dataclass(frozen=True, eq=False)
class Clearance:
    """Clearance, collision bound and deviation by noise along a motion of n steps."""

    rows: np.ndarray
    """Time [s], clearance [cm] and bound of Eq. 1 [%] of each step (3, n)."""
    deviations: np.ndarray | None = None
    """Standard deviations of the position by noise, along the worse level axis and the vertical, at each of the states
    (n + 1, 2) [m]; None where no room is kept for noise."""

    @property
    def smallest_m(self) -> float | None:
        """Smallest clearance [m]; None for a motion without steps."""
        return 0.01 * float(self.rows[1].min()) if self.rows.shape[1] else None

    @property
    def bound(self) -> float:
        """Bound of Eq. 1 on the collision probability of the motion, 0 to 1."""
        return min(1.0, 0.01 * float(self.rows[2].sum()))


def find_shown_motion(session: Session) -> ShownMotion | None:
    """Find the motion that is shown as the plan: that of the time step of a flight, else a finished plan."""
    flight, plan = session.shown_flight, session.plan
    if session.flight_is_shown and flight is not None and flight.steps:
        last = flight.steps[-1]
        return ShownMotion(last.plan, last.time, flown=True) if _is_finite(last.plan) else None
    if plan is None or plan.latest is None or plan.outcome is None or not _is_finite(plan.latest.motion):
        return None
    return ShownMotion(plan.latest.motion)


@dataclass(frozen=True, eq=False)
class ClearanceQuery(LongQuery[Clearance]):
    """Query for the clearance of a motion. Two queries for the same motion are equal."""

    reads_field: ClassVar[bool] = True
    shown: ShownMotion
    unknown: UnknownSpace = UnknownSpace.OCCUPIED
    """Occupancy that is assumed of space that no camera saw."""
    context: NoiseContext | None = None
    """Noise for which the plan keeps room; None where it keeps none, and in flight."""
    jobs_begun: int = 0
    """Number of jobs when it was asked."""
    hurried: bool = False
    """True in a flight that is not paused: then stretches of several steps are measured, in a quarter of the time."""

    def __eq__(self, other: object) -> bool:
        """Compare motions as objects: one is kept, so that no other one can take its address."""
        if not isinstance(other, ClearanceQuery):
            return False
        return self.shown.motion is other.shown.motion and self.hurried == other.hurried

    def __hash__(self) -> int:
        return hash((type(self), id(self.shown.motion), self.hurried))

    @property
    def pause(self) -> float:
        """Pause so that a flight is not slowed down."""
        return _PAUSE if self.hurried else 0.0

    @classmethod
    def pending(cls, session: Session) -> Iterator["ClearanceQuery"]:
        """Ask for what is shown, while no job runs but a flight, and no hand drags an end."""
        if session.held or (session.job is not None and not session.in_flight):
            return
        shown = find_shown_motion(session)
        if shown is not None:
            settings = session.plan_settings if session.plan is None else session.plan.settings
            context = None if shown.flown or session.plan is None else _context_of(session.plan)
            hurried = session.job is not None and not session.job.paused
            yield cls(shown, settings.unknown, context, session.jobs_begun, hurried)

    @classmethod
    def result_shown(cls, session: Session) -> Clearance | None:
        """Return the clearance of the motion that is shown; in flight, that of a moment ago."""
        asked, shown = cls.asked_in(session), find_shown_motion(session)
        if asked is None or shown is None:
            return None
        lags = session.in_flight and asked.shown.flown and asked.jobs_begun == session.jobs_begun
        return cls.result_in(session) if lags or asked.shown.motion is shown.motion else None

    @torch.no_grad()
    def steps(self, resources: Resources) -> Generator[None, None, Clearance]:
        """Measure the densities around the body at each step, and the distance from announced movers, as plans do.

        In flight it is one step, for the next time step waits for it.
        """
        place = prepare_place(resources.place, self.unknown)
        motion, body, config = self.shown.motion, place.robot.body, SafetyConfig()
        _, reach, _ = config.lengths(place.field, body)
        bound = PathDensity.of(place.field, motion, body).bound_per_step
        count = len(motion.actions)
        parts = np.array_split(np.arange(count), min(_STRETCHES, count) if self.hurried else count) if count else []
        room = []
        for part in parts:
            room.append(measure_clearance(place.field, _cut(motion, part), body, config))
            if not self.hurried:
                yield
        # where nothing is within reach, the clearance is at least the reach
        clearance = np.repeat([reach if free is None else free for free in room], [len(part) for part in parts])
        if place.announced_movers is not None:
            gaps, bound = count_movers(place.announced_movers, motion, body, bound, self.shown.begins_s)
            clearance = np.minimum(clearance, gaps.numpy())
        times = self.shown.begins_s + motion.dt * (1 + np.arange(count))
        rows = np.stack([times, 100 * clearance, 100 * bound.numpy()])
        context = self.context
        if context is None:
            return Clearance(rows)
        place, height = resources.place, motion.states.position[0, 2].item()
        config = NavigateConfig(FilterConfig().for_field(place.field.info), context.noise)
        noise = expect_noise_in(place, config, context.world, self.unknown, OccupancyConfig(), height)
        return Clearance(rows, deviations_along(motion, planning_robot(place.robot, context.world), noise))


def deviations_along(motion: Motion, robot: Robot, noise: NoiseModel) -> np.ndarray:
    """Predict standard deviations by noise at the n + 1 states of a motion, level and vertical (n + 1, 2) [m]."""
    with torch.enable_grad():  # the dynamics are differentiated
        known = tracking_deviations(robot, motion.dt, noise)
    first = [(each.level, each.height) for each in known]
    count = len(motion.actions) + 1
    return np.array([first[min(max(index - 1, 0), len(first) - 1)] for index in range(count)])


def _cut(motion: Motion, steps: np.ndarray) -> Motion:
    """Cut successive steps out of a motion."""
    first, last = int(steps[0]), int(steps[-1])
    return Motion(motion.states[first : last + 2], motion.actions[first : last + 1], motion.dt)


def _context_of(plan: PlanRecord) -> NoiseContext | None:
    return None if plan.settings.paper_cost else NoiseContext(plan.flight.noise, plan.flight.world)


def _is_finite(motion: Motion) -> bool:
    return bool(motion.states.position.isfinite().all())
