"""Command palette: every command by keyboard (Ctrl+K), with its shortcut.

A command posts the same message as its button; it is greyed out where its button is.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from operator import attrgetter
from typing import Any

import viser

import nerfnav_scenes as scenes
from nerfnav import robots
from nerfnav.planner import PLANNERS
from nerfnav_app.page.kit.widgets import confirm_reset
from nerfnav_app.state.actions import (
    Adjust,
    AimEnd,
    Cancel,
    Choose,
    ChooseTask,
    Command,
    FindRobot,
    Gust,
    KidnapRobot,
    OpenPlace,
    Pause,
    Redo,
    Reset,
    Resume,
    Settings,
    StartComparison,
    StartFlight,
    StartPlan,
    StepOnce,
    Undo,
)
from nerfnav_app.state.job import JobKind
from nerfnav_app.state.obstacles import ChooseMode, GizmoMode
from nerfnav_app.state.runs import CompareRun, PlayBack, Scrub
from nerfnav_app.state.session import Session
from nerfnav_app.state.view import CameraMode


@dataclass(frozen=True)
class InBrowser:
    """Command that a browser alone can follow, as picks.js does: turn to a tab, or press a button that opens a file."""


@dataclass(frozen=True)
class Shortcut:
    """One command of the palette."""

    label: str
    """Its label."""
    asks: "Callable[[Session], Command | InBrowser | None]"
    """Builds the command; None where it is not possible now."""
    key: Any = None
    """Key of its shortcut."""
    has_key: Callable[[Session], bool] = lambda _: True
    """False while its key is that of another command."""
    modifier: Any = None
    """Modifier of the shortcut."""
    icon: Any = None
    """Beside its label."""
    hint: str | None = None
    """Below its label."""
    confirm: Callable[[viser.ClientHandle, Callable[[Command], None]], None] | None = None
    """Asks the tab for a confirmation, and posts the command then; None posts it at once."""


class CommandPalette:
    """Panel of the command palette: its commands, enabled as the session allows."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """Add the widgets; `post` takes the commands."""
        self._session: Session | None = None
        self._commands = [(entry, self._add(server, post, entry)) for entry in entries()]

    def _add(self, server: viser.ViserServer, post: Callable[[Command], None], entry: Shortcut) -> viser.CommandHandle:
        handle = server.gui.add_command(
            entry.label,
            description=entry.hint,
            hotkey=entry.key,
            modifier=entry.modifier,
            icon=entry.icon,
            disabled=True,
        )

        @handle.on_trigger
        async def _(event: Any) -> None:
            client, session = event.client, self._session
            command = None if session is None or client is None else entry.asks(session)
            if command is None or client is None:
                return
            if entry.confirm is not None:
                entry.confirm(client, post)
            elif not isinstance(command, InBrowser):
                post(command)

        return handle

    def show(self, session: Session) -> None:
        """Disable the commands that are not possible now, and give each key to one command."""
        self._session = session
        for entry, handle in self._commands:
            disabled, key = entry.asks(session) is None, entry.key if entry.has_key(session) else None
            if handle.disabled != disabled:
                handle.disabled = disabled
            if handle.hotkey != key:
                handle.hotkey = key


def entries() -> tuple[Shortcut, ...]:
    """List all commands, the frequent ones first."""
    icons = viser.Icon
    return (
        Shortcut("Plan", _when("may_begin", StartPlan()), "P", icon=icons.ROUTE),
        Shortcut("Fly", _when("may_begin", StartFlight()), "F", icon=icons.DRONE),
        Shortcut("Pause, resume, play back", _hold, "space", icon=icons.PLAYER_PAUSE),
        Shortcut("One time step back", _look(-1), "pageup", icon=icons.PLAYER_TRACK_PREV),
        Shortcut("One time step ahead", _look(1), "pagedown", icon=icons.PLAYER_TRACK_NEXT),
        Shortcut("Step", _when("in_flight", StepOnce()), "S", icon=icons.PLAYER_TRACK_NEXT, hint="One time step"),
        Shortcut("Gust", _when("flight", Gust()), "G", icon=icons.WIND, hint="Push the robot once"),
        Shortcut("Kidnap the robot", _when("in_flight", KidnapRobot()), icon=icons.HAND_GRAB,
                 hint="Move it without a report to its filter"),
        Shortcut("Find the robot", _when("may_find", FindRobot()), icon=icons.MAP_SEARCH,
                 hint="Global localization by its last picture"),
        Shortcut("Stop", lambda session: Cancel() if _may_stop(session) else None, "X", icon=icons.X),
        Shortcut("Stop placing", _when("aiming", AimEnd(None)), "escape", icon=icons.POINTER_OFF,
                 hint="Clicks into the scene place nothing, or end a path"),
        Shortcut("Next task", _next_task, "T", icon=icons.ARROW_RIGHT, hint="Start and goal of the scene's next task"),
        Shortcut("Reset", _when("place", Reset()), "R", modifier="shift", icon=icons.REFRESH, confirm=confirm_reset),
        Shortcut("Undo", _when("history.past", Undo()), "Z", modifier="cmd/ctrl", icon=icons.ARROW_BACK_UP),
        Shortcut("Redo", _when("history.future", Redo()), "Y", modifier="cmd/ctrl", icon=icons.ARROW_FORWARD_UP),
        *(Shortcut(f"Camera: {mode.value}", _see(mode), str(key), icon=icons.EYE,
                   has_key=lambda session, key=key: key > len(GizmoMode) or not _chooses_obstacle(session))
          for key, mode in enumerate(CameraMode, 1)),
        *(Shortcut(f"Obstacle: {mode.value.lower()}", _handle(mode), str(key), _chooses_obstacle, icon=icons.CUBE,
                   hint="What the handles of the chosen obstacle do")
          for key, mode in enumerate(GizmoMode, 1)),
        Shortcut("Compare planners", _when("may_begin", StartComparison()), icon=icons.SCALE,
                 hint="Plan between the same ends with each of them"),
        Shortcut("Compare flights", _compare, icon=icons.HISTORY, hint="Show the last stored flight beside this one"),
        Shortcut("Line by clearance", _color_by_clearance, icon=icons.PALETTE,
                 hint="Colour the plan by the robot's clearance, or no longer"),
        Shortcut("Open a file", lambda _: InBrowser(), icon=icons.UPLOAD,
                 hint="A field, a mesh, Gaussian splats, a capture, a video"),
        Shortcut("Export", _when("place", InBrowser()), icon=icons.DOWNLOAD, hint="Turn to the tab of the exports"),
        Shortcut("Screenshot", _when("place", InBrowser()), icon=icons.CAMERA, hint="Download the scene as you see it"),
        *(Shortcut(f"Open {name}", _open(name), icon=icons.MAP_2) for name in scenes.with_fields()),
        *(Shortcut(f"Planner: {name}", _choose("planner", name), icon=icons.ROUTE) for name in PLANNERS),
        *(Shortcut(f"Robot: {name}", _choose("robot", name), icon=icons.DRONE) for name in robots.names()),
    )  # fmt: skip


def _compare(session: Session) -> Command | None:
    """Compare the shown flight with the newest other one of the place."""
    shown = session.runs.opened if session.flight is not None else None
    if session.flight is None or session.growing:
        return None
    name = shown.entry.name if shown is not None and shown.record is session.flight else None
    there = [entry.name for entry in session.runs.entries if session.is_place_of(entry)]
    # a flight that has just ended is the newest one itself
    others = [other for other in there if other != name] if name is not None else there[1:]
    return CompareRun(others[0]) if others else None


def _color_by_clearance(session: Session) -> Command | None:
    return Adjust(Settings.VIEW, "clearance", not session.view_settings.clearance) if session.place else None


def _when(state: str, command: "Command | InBrowser") -> "Callable[[Session], Command | InBrowser | None]":
    """Allow a command while that attribute of the session is true, or not empty."""
    allowed = attrgetter(state)
    return lambda session: command if allowed(session) else None


def _see(mode: CameraMode) -> Callable[[Session], Command | None]:
    return lambda session: Adjust(Settings.VIEW, "camera", mode) if session.view_settings.camera is not mode else None


def _handle(mode: GizmoMode) -> Callable[[Session], Command | None]:
    return lambda session: ChooseMode(mode) if _chooses_obstacle(session) and session.gizmo_mode is not mode else None


def _chooses_obstacle(session: Session) -> bool:
    return session.chosen_obstacle is not None


def _open(name: str) -> Callable[[Session], Command | None]:
    return lambda session: OpenPlace(name) if session.what != name else None


def _hold(session: Session) -> Command | None:
    if session.job is None or not session.in_flight:
        return PlayBack(not session.runs.timeline.playing) if _may_look_back(session) else None
    return Resume() if session.job.paused else Pause()


def _may_look_back(session: Session) -> bool:
    return session.timed is not None and len(session.timed.steps) > 1 and not session.growing


def _look(by: int) -> Callable[[Session], Command | None]:
    def ask(session: Session) -> Command | None:
        shown = session.runs.shown(session.timed)
        return Scrub(len(shown.steps) - 1 + by) if _may_look_back(session) and shown is not None else None

    return ask


def _may_stop(session: Session) -> bool:
    """Check for a job that can be stopped; the first place must be opened."""
    return session.job is not None and (session.job.kind is not JobKind.OPEN or session.before is not None)


def _next_task(session: Session) -> Command | None:
    names = [task.name for task in session.place.tasks] if session.place is not None else []
    if not names:
        return None
    return ChooseTask(names[(names.index(session.task) + 1) % len(names) if session.task in names else 0])


def _choose(field: str, name: str) -> Callable[[Session], Command | None]:
    def ask(session: Session) -> Command | None:
        if session.place is None or getattr(session.choice, field) == name:
            return None
        return Choose(replace(session.choice, **{field: name}))

    return ask
