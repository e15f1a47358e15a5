"""How one number of the session's settings changes: checked, for what a browser sends can be anything."""

from dataclasses import replace
from typing import Any, TypeVar

from app.reducers.common import noticed
from app.state.actions import Settings
from app.state.flight_settings import FlightSettings
from app.state.plan_settings import PlanSettings
from app.state.session import Session
from app.state.view_settings import ViewSettings
from app.text import sentence
from nerfnav.errors import InvalidInputError


def adjusted(session: Session, settings: Settings, name: str, value: Any) -> Session:
    """The session with one number of its settings changed, or with a notice that says what would be right."""
    try:
        return _with(session, settings, {name: value})
    except InvalidInputError as error:
        return noticed(session, "Not taken", sentence(str(error)), bad=True)


def _with(session: Session, settings: Settings, change: dict[str, Any]) -> Session:
    match settings:
        case Settings.VIEW:
            return replace(session, view_settings=_checked(replace(session.view_settings, **change)))
        case Settings.PLAN:
            return replace(session, plan_settings=_checked(replace(session.plan_settings, **change)))
        case Settings.WEIGHTS:
            weights = replace(session.plan_settings.weights, **change)
            return replace(session, plan_settings=_checked(replace(session.plan_settings, weights=weights)))
        case Settings.FLIGHT:
            flying = _checked(replace(session.flight_settings, **change))
            # the pace counts for the flight under way too
            job = None if session.job is None else replace(session.job, pace=flying.pace)
            return replace(session, flight_settings=flying, job=job)


Checkable = TypeVar("Checkable", ViewSettings, PlanSettings, FlightSettings)


def _checked(settings: Checkable) -> Checkable:
    settings.check()
    return settings
