"""Reducer of settings: one number changes, validated where it is typed freely; or all are as they were at first."""

from dataclasses import replace
from typing import Any

from nerfnav.core.errors import InvalidInputError
from nerfnav_app.places.ends import default_ends
from nerfnav_app.places.place import Place
from nerfnav_app.reducers import jobs
from nerfnav_app.reducers.common import add_notice, choose_settings
from nerfnav_app.state.actions import Settings
from nerfnav_app.state.flight import FlightSettings
from nerfnav_app.state.place import Choice
from nerfnav_app.state.plan import PlanSettings
from nerfnav_app.state.session import Session
from nerfnav_app.state.view import ViewSettings
from nerfnav_app.text import sentence


def adjust_setting(session: Session, settings: Settings, name: str, value: Any) -> Session:
    """Adjust one number of the settings; add a notice with the valid range where it is invalid."""
    try:
        return _with(session, settings, {name: value})
    except InvalidInputError as error:
        return add_notice(session, "Not applied", sentence(str(error)), bad=True)


def _with(session: Session, settings: Settings, change: dict[str, Any]) -> Session:
    match settings:
        case Settings.VIEW:
            return replace(session, view_settings=replace(session.view_settings, **change))
        case Settings.PLAN:
            if "duration_s" in change:  # a typed duration replaces the found one
                change = {"shortest": False, **change}
            planning = replace(session.plan_settings, **change)
            planning.check()
            if planning.unknown is not session.plan_settings.unknown:  # which decides where the robot fits
                session = replace(session, problems={}, offers={})
            return replace(session, plan_settings=planning)
        case Settings.WEIGHTS:
            weights = replace(session.plan_settings.weights, **change)
            return _with(session, Settings.PLAN, {"weights": weights})
        case Settings.FLIGHT:
            flying = replace(session.flight_settings, **change)
            # the pace counts for the flight under way too
            job = None if session.job is None else replace(session.job, pace=flying.pace)
            return replace(session, flight_settings=flying, job=job)


def reset_settings(session: Session, place: Place) -> Session:
    """Reset the session to the state after opening the place, but for the chosen robot and task."""
    ends = session.first_ends or default_ends(place, None) or session.ends
    return replace(
        jobs.discard_results(session), task=session.home, ends=ends, problems={}, offers={}, outside={}, held=False,
        aiming=None, clicked=None, obstacles=(), motion_time=None, choice=Choice(session.choice.robot),
        flight_settings=FlightSettings(),
        plan_settings=choose_settings(PlanSettings(), place, ends, session.home),
        view_settings=ViewSettings().for_place(splats=place.splats is not None),
    )  # fmt: skip
