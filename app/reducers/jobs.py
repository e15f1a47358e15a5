"""Reducer of jobs: begin and cancel them, and steer a flight that is under way."""

from dataclasses import replace

from nerfnav_app.reducers.common import add_notice
from nerfnav_app.state import actions as m
from nerfnav_app.state.alignment import UNFINISHED
from nerfnav_app.state.flight import FlightRecord
from nerfnav_app.state.job import DownloadRequest, Job, JobKind, MapDownload, TrajectoryDownload
from nerfnav_app.state.plan import (
    AllowTime,
    DeclineFlight,
    EndComparison,
    HighlightPlanner,
    PlanAction,
    PlanRecord,
    RestoreWeights,
)
from nerfnav_app.state.runs import StartExperiment
from nerfnav_app.state.session import Session
from nerfnav_app.state.tracks import RemoveTrack, StartTrack, TrackAction, TrackRecord

JobCommand = (
    m.StartComparison
    | m.StartPlan
    | m.StartFlight
    | PlanAction
    | m.FindRobot
    | DownloadRequest
    | m.Cancel
    | StartExperiment
    | TrackAction
)


def command_job(session: Session, command: JobCommand) -> Session:
    """Reduce a command in an open place."""
    match command:
        case m.StartComparison():
            return begin_job(session, JobKind.COMPARE)
        case m.StartPlan():
            return _begin_plan(session)
        case m.StartFlight(anyway):
            return _begin_flight(session, anyway)
        case DeclineFlight():
            return replace(session, unconfirmed=None)
        case HighlightPlanner(name):
            return replace(session, highlighted=name)
        case EndComparison():
            # while planners are still compared, the next result would bring it back
            return session if session.job is not None else replace(session, comparison=(), highlighted=None)
        case AllowTime(seconds):
            return begin_job(replace(session, plan_settings=session.plan_settings.with_duration(seconds)), JobKind.PLAN)
        case RestoreWeights():
            weighed = session.plan_settings.default_cost()
            return begin_job(replace(session, plan_settings=weighed), JobKind.PLAN)
        case StartExperiment():
            asked = replace(session, experiments=session.experiments.commanded(command))
            return begin_job(asked, JobKind.EXPERIMENT)
        case m.FindRobot():
            return _begin_search(session)
        case StartTrack():
            return _begin_track(session, command)
        case RemoveTrack():
            return session if session.growing else replace(session, track=None)
        case MapDownload():
            return begin_job(session, JobKind.MAP, command)
        case TrajectoryDownload():
            return begin_job(session, JobKind.EXPORT, command)
        case m.Cancel():
            return cancel_job(session)


_BETWEEN_ENDS = (JobKind.PLAN, JobKind.COMPARE, JobKind.FLY)
"""Jobs that need start and goal."""


def begin_job(
    session: Session, kind: JobKind, request: DownloadRequest | None = None, anyway: PlanRecord | None = None
) -> Session:
    """Begin a job of this kind, on a fresh record; add a notice where another one runs.

    A flight begins with the plan that is shown, or with one that is to be flown `anyway`.
    """
    if not session.may_begin:
        return add_notice(session, "Still busy", "One thing at a time: stop what is running first.", bad=True)
    # the middle of the box, where ends are until they are found, may do for a robot that flies, and is no floor
    waits = session.seeking and session.place is not None and session.place.robot.planar
    if waits and kind in _BETWEEN_ENDS:
        return add_notice(session, "Not yet", "Start and goal are still searched: wait a moment.", bad=True)
    if session.alignment.is_moving and kind in _BETWEEN_ENDS:
        return add_notice(session, *UNFINISHED, bad=True)
    job = Job(session.jobs_begun, kind, session.ends, pace=session.flight_settings.pace, request=request)
    if kind is JobKind.FLY:
        job = replace(job, first_plan=anyway or session.fresh_plan, anyway=anyway is not None)
    fresh = replace(session, job=job, jobs_begun=session.jobs_begun + 1, seeking=waits)
    if kind is JobKind.COMPARE:
        return replace(fresh, comparison=(), highlighted=None)
    if kind in (JobKind.EXPERIMENT, JobKind.FIND, JobKind.MAP, JobKind.EXPORT, JobKind.PLACE, JobKind.TRACK):
        return fresh
    fresh = replace(fresh, flight=None, track=None, unconfirmed=None, held=False, comparison=(), search=None)
    if kind is JobKind.PLAN:
        return replace(fresh, plan=session.new_plan(session.ends))
    flight = FlightRecord(
        session.ends, flown_by=session.flown_by, flown_in=session.field_made_by, obstacles=session.placed_obstacles
    )
    return replace(fresh, plan=job.first_plan, flight=flight, motion_time=None)


def _begin_plan(session: Session) -> Session:
    """Begin to plan, now or once the place is shown: the job that makes its surface is not stopped."""
    job = session.job
    if job is not None and job.kind is JobKind.OPEN and not session.may_begin:
        return replace(session, job=replace(job, plan_after=True))
    return begin_job(session, JobKind.PLAN)


def _begin_flight(session: Session, anyway: bool) -> Session:
    """Begin to fly, or ask the user first, where the plan is known not to be safe, or its risk is high."""
    doubtful = session.doubtful_plan
    if doubtful is None or not doubtful.leads or not session.may_begin:
        return begin_job(session, JobKind.FLY)  # which plans by itself, where no plan was found
    return begin_job(session, JobKind.FLY, anyway=doubtful) if anyway else replace(session, unconfirmed=doubtful)


def _begin_track(session: Session, command: StartTrack) -> Session:
    """Begin to track a camera, in place of a flight."""
    if not session.may_begin:
        return begin_job(session, JobKind.TRACK)  # which adds the notice
    session = begin_job(replace(session, flight=None, search=None, track=TrackRecord(command.name)), JobKind.TRACK)
    return session if session.job is None else replace(session, job=replace(session.job, track=command))


def _begin_search(session: Session) -> Session:
    """Begin to search for the robot in the last picture of its flight."""
    if session.last_picture is None:
        return add_notice(session, "No picture", "There is no camera picture yet: fly first.", bad=True)
    return begin_job(session, JobKind.FIND)


def discard_results(session: Session) -> Session:
    """Discard the job and the results of jobs."""
    cancelled = cancel_job(session)
    return replace(cancelled, plan=None, flight=None, track=None, unconfirmed=None, comparison=(), search=None)


def cancel_job(session: Session) -> Session:
    """Cancel the job; once a place is open, a job that only makes later ones quicker goes on."""
    if session.job is None:
        return session
    opened = session.job.kind is JobKind.OPEN and session.place is not None
    return session if opened else abandon_job(session)


def abandon_job(session: Session) -> Session:
    """Abandon the job; where a place is not open yet, go back to the place before it."""
    before = session.before
    if session.place is not None or before is None:
        return replace(session, job=None)
    return replace(before, job=None, jobs_begun=session.jobs_begun, notices=session.notices)


Steering = m.Pause | m.Resume | m.StepOnce | m.Gust | m.KidnapRobot | m.FindRobot


def steer_flight(session: Session, command: Steering) -> Session:
    """Steer the flight under way."""
    job = session.job
    if job is None or not session.in_flight:
        return refuse_gust(session) if isinstance(command, m.Gust) else session
    return replace(session, job=_steer_job(job, command, session.steps_reported))


def refuse_gust(session: Session) -> Session:
    """Report that a gust was requested after the end of a flight, or without one."""
    return add_notice(session, "No gust", "There is no flight to push: press Fly first.")


def _steer_job(job: Job, command: Steering, steps: int) -> Job:
    match command:
        case m.Pause():
            return replace(job, paused=True, allowed_steps=steps)
        case m.Resume():
            return replace(job, paused=False)
        case m.StepOnce():
            return replace(job, paused=True, allowed_steps=steps + 1)
        case m.Gust():
            return replace(job, gusts=job.gusts + 1)
        case m.KidnapRobot():
            return replace(job, kidnaps=job.kidnaps + 1)
        case m.FindRobot():
            return replace(job, searches=job.searches + 1)
