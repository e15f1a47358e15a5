"""Reducer of settings: one number changes, validated where it is typed freely; or all are as they were at first."""

from dataclasses import replace
from typing import Any

from nerfnav.core.errors import InvalidInputError
from nerfnav_app.places.ends import default_ends
from nerfnav_app.places.place import Place
from nerfnav_app.reducers import jobs
from nerfnav_app.reducers.common import first_settings, noticed
from nerfnav_app.state.actions import Settings
from nerfnav_app.state.session import Session
from nerfnav_app.state.settings import Choice, FlightSettings, PlanSettings
from nerfnav_app.state.view import ViewSettings
from nerfnav_app.text import sentence


def adjusted(session: Session, settings: Settings, name: str, value: Any) -> Session:
    """The session with one number of its settings changed, or with a notice that says what would be right."""
    try:
        return _with(session, settings, {name: value})
    except InvalidInputError as error:
        return noticed(session, "Not taken", sentence(str(error)), bad=True)


def _with(session: Session, settings: Settings, change: dict[str, Any]) -> Session:
    match settings:
        case Settings.VIEW:
            return replace(session, view_settings=replace(session.view_settings, **change))
        case Settings.PLAN:
            if "duration_s" in change:  # what somebody says takes the place of what is found
                change = {"shortest": False, **change}
            planning = _checked(replace(session.plan_settings, **change))
            if planning.unknown is not session.plan_settings.unknown:  # which decides where the robot fits
                session = replace(session, problems={}, offers={})
            return replace(session, plan_settings=planning)
        case Settings.WEIGHTS:
            weights = replace(session.plan_settings.weights, **change)
            return replace(session, plan_settings=_checked(replace(session.plan_settings, weights=weights)))
        case Settings.FLIGHT:
            flying = replace(session.flight_settings, **change)
            # the pace counts for the flight under way too
            job = None if session.job is None else replace(session.job, pace=flying.pace)
            return replace(session, flight_settings=flying, job=job)


def _checked(settings: PlanSettings) -> PlanSettings:
    settings.check()
    return settings


def reset(session: Session, place: Place) -> Session:
    """The session as it was once the place was open, the robot and the task that were chosen since excepted."""
    ends = session.first_ends or default_ends(place, None) or session.ends
    return replace(
        jobs.emptied(session), task=session.home, ends=ends, problems={}, offers={}, outside={}, held=False,
        aiming=None, clicked=None, choice=Choice(session.choice.robot), flight_settings=FlightSettings(),
        plan_settings=first_settings(PlanSettings(), place, ends, session.home),
        view_settings=ViewSettings().where(splats=place.splats is not None),
    )  # fmt: skip
