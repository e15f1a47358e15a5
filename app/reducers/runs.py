"""Reducer of stored runs and the timeline."""

from dataclasses import replace
from pathlib import Path

import torch

from nerfnav.core.errors import NerfnavError
from nerfnav_app.reducers.common import add_notice
from nerfnav_app.state.actions import RunChanged
from nerfnav_app.state.runs import (
    CompareRun,
    DeleteRun,
    ListRuns,
    OpenRun,
    PlayBack,
    RenameRun,
    RunAction,
    RunChange,
    Runs,
    Scrub,
    StoredFlight,
)
from nerfnav_app.state.session import Session

_OFFERED = 3
"""Flights that a refusal names at most."""


def find_other_source(session: Session, name: str) -> str | None:
    """Find the place that has to be opened before a flight can be shown; None where it is open, or unknown."""
    entry = session.runs.entry(name)
    if entry is None or session.in_flight or session.place is None:
        return None
    return None if session.is_place_of(entry) else entry.metadata.source


def command_runs(session: Session, command: RunAction) -> Session:
    """Reduce a command of the user."""
    runs, flight = session.runs, session.timed
    match command:
        case ListRuns():
            return replace(session, runs=replace(runs, listed=None))
        case OpenRun(name):
            if session.in_flight:
                return add_notice(session, "Still flying", "Stop the flight before you open another one.", bad=True)
            return replace(session, runs=runs.wanting(name))
        case CompareRun(None):
            return replace(session, runs=replace(runs, compared=None))
        case CompareRun(str(name)):
            entry = runs.entry(name)
            if entry is not None and not session.is_place_of(entry):
                return _refuse_other_place(session, name, entry.metadata.place)
            return replace(session, runs=runs.wanting(name, compare=True))
        case RenameRun(name, to):
            return replace(session, runs=runs.changing(name, to))
        case DeleteRun(name):
            return replace(session, runs=runs.changing(name, None))
    if flight is None or not flight.steps or session.growing:
        return session
    match command:
        case Scrub(at):
            return replace(session, runs=replace(runs, timeline=runs.timeline.moved(flight, at)))
        case PlayBack(on):
            timeline = runs.timeline.started(flight) if on else replace(runs.timeline, playing=False)
            return replace(session, runs=replace(runs, timeline=timeline))
    return session


def finish_change(session: Session, done: RunChanged) -> Session:
    """Finish the change of a stored run, or report its failure; an opened flight stays in sight."""
    change, runs = done.change, session.runs
    left = tuple(other for other in runs.changes if other != change)
    session = replace(session, runs=replace(runs, changes=left, listed=None))
    if done.problem is not None:
        return add_notice(session, f"Could not {change.verb}", done.problem, bad=True)
    return replace(session, runs=_forgotten(session.runs, change))


def roll_timeline(session: Session, seconds: float) -> Session:
    """Advance a running timeline by some time [s]."""
    timeline = session.runs.timeline
    if not timeline.playing:
        return session
    if timeline.flight is not session.timed:
        timeline = replace(timeline, playing=False)
    return replace(session, runs=replace(session.runs, timeline=timeline.rolled(seconds)))


def show_run(session: Session, stored: StoredFlight) -> Session:
    """Show a stored flight as the flight of the session, with its robot, its ends and its obstacles."""
    place, about = session.place, stored.entry.metadata
    if place is None or session.growing:
        return session
    if about.robot != session.choice.robot:
        try:
            place = place.with_robot(about.robot)
        except NerfnavError:  # whose text names a folder, and browsers read this
            text = f"The robot {Path(about.robot).stem} is missing, or its file is invalid: load it again."
            return add_notice(session, "Could not open", text, bad=True)
    timeline = session.runs.timeline.moved(stored.record, len(stored.record.steps) - 1)  # show all of it at once
    return replace(
        session, place=place, choice=replace(session.choice, robot=about.robot), task=None, ends=about.ends,
        seeking=False, problems={}, offers={}, outside={}, plan=None, flight=stored.record, track=None, search=None,
        comparison=(), results={}, obstacles=stored.obstacles, chosen=None, aiming=None, motion_time=None,
        runs=replace(session.runs, opened=stored, timeline=timeline),
    )  # fmt: skip


def compare_run(session: Session, stored: StoredFlight) -> Session:
    """Show a stored flight beside the present one."""
    if not session.is_place_of(stored.entry):
        return _refuse_other_place(session, stored.entry.name, stored.entry.metadata.place)
    if _is_shown(session, stored):
        reason = f"{stored.entry.name} is the flight that is shown: choose another one to compare it with."
        return add_notice(session, "The same flight", reason, bad=True)
    return replace(session, runs=replace(session.runs, compared=stored))


def _refuse_other_place(session: Session, name: str, place: str) -> Session:
    """Say that flights of different places are not compared, and name some that can be."""
    here = session.place.name if session.place is not None else session.what
    others = [other.name for other in session.runs.entries if session.is_place_of(other)]
    offer = f"choose {' or '.join(others[:_OFFERED])}" if others else f"fly in {here} first"
    reason = f"{name} was flown in {place}, and {here} is open: {offer}."
    return add_notice(session, "Another place", reason, bad=True)


def _is_shown(session: Session, stored: StoredFlight) -> bool:
    """Check whether a stored flight is the one on the page; one that has just ended is compared by its states."""
    flight, opened = session.flight, session.runs.opened
    if flight is None or (opened is not None and opened.record is flight):
        return flight is not None and opened is not None and opened.entry.name == stored.entry.name
    paths = [[step.truth.position for step in record.steps] for record in (flight, stored.record)]
    return len(paths[0]) == len(paths[1]) and all(map(torch.equal, *paths))


def _forgotten(runs: Runs, change: RunChange) -> Runs:
    """Rename or remove the runs of a changed name."""
    kept = {}
    for part in ("opened", "compared"):
        stored: StoredFlight | None = getattr(runs, part)
        if stored is not None and stored.entry.name == change.name:
            kept[part] = None if change.to is None else replace(stored, entry=replace(stored.entry, name=change.to))
    return replace(runs, **kept)
