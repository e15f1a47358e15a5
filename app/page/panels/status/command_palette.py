"""Command palette: every command by keyboard (Ctrl+K), with its shortcut.

A command posts the same message as its button; it is greyed out where its button is.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import viser

import nerfnav_scenes as scenes
from nerfnav import robots
from nerfnav.planner import PLANNERS
from nerfnav_app.state.actions import (
    Adjust,
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
    StartFlight,
    StartPlan,
    StepOnce,
    Undo,
)
from nerfnav_app.state.job import JobKind
from nerfnav_app.state.runs import PlayBack, Scrub
from nerfnav_app.state.session import Session
from nerfnav_app.state.view import CameraMode


@dataclass(frozen=True)
class Shortcut:
    """One command of the palette."""

    label: str
    """Its label."""
    asks: Callable[[Session], Command | None]
    """Builds the command; None where it is not possible now."""
    key: Any = None
    """Key of its shortcut."""
    modifier: Any = None
    """Modifier of the shortcut."""
    icon: Any = None
    """Beside its label."""
    hint: str | None = None
    """Below its label."""


class CommandPalette:
    """Panel of the command palette: its commands, enabled as the session allows."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """Add the widgets; `post` takes the commands."""
        self._post = post
        self._session: Session | None = None
        self._commands = [(entry, self._add(server, entry)) for entry in entries()]

    def _add(self, server: viser.ViserServer, entry: Shortcut) -> viser.CommandHandle:
        handle = server.gui.add_command(
            entry.label,
            description=entry.hint,
            hotkey=entry.key,
            modifier=entry.modifier,
            icon=entry.icon,
            disabled=True,
        )

        @handle.on_trigger
        async def _(_: viser.CommandEvent) -> None:
            asked = entry.asks(self._session) if self._session is not None else None
            if asked is not None:
                self._post(asked)

        return handle

    def show(self, session: Session) -> None:
        """Disable the commands that are not possible now."""
        self._session = session
        for entry, handle in self._commands:
            disabled = entry.asks(session) is None
            if handle.disabled != disabled:
                handle.disabled = disabled


def entries() -> Iterator[Shortcut]:
    """List all commands, the frequent ones first."""
    icons = viser.Icon
    yield Shortcut("Plan", _when_free(StartPlan()), "P", icon=icons.ROUTE)
    yield Shortcut("Fly", _when_free(StartFlight()), "F", icon=icons.DRONE)
    yield Shortcut("Pause, resume, play back", _hold, "space", icon=icons.PLAYER_PAUSE)
    yield Shortcut("One time step back", _look(-1), "pageup", icon=icons.PLAYER_TRACK_PREV)
    yield Shortcut("One time step ahead", _look(1), "pagedown", icon=icons.PLAYER_TRACK_NEXT)
    yield Shortcut("Step", _when_flying(StepOnce()), "S", icon=icons.PLAYER_TRACK_NEXT, hint="One time step")
    yield Shortcut("Gust", _when_flying(Gust()), "G", icon=icons.WIND, hint="Push the robot once")
    yield Shortcut(
        "Kidnap the robot",
        _when_flying(KidnapRobot()),
        icon=icons.HAND_GRAB,
        hint="Move it without a report to its filter",
    )
    yield Shortcut("Find the robot", lambda session: FindRobot() if session.may_find else None, icon=icons.MAP_SEARCH,
                hint="Global localization by its last picture")  # fmt: skip
    yield Shortcut("Stop", lambda session: Cancel() if _may_stop(session) else None, "X", icon=icons.X)
    yield Shortcut("Next task", _next_task, "T", icon=icons.ARROW_RIGHT, hint="Start and goal of the scene's next task")
    yield Shortcut("Reset", lambda session: Reset() if session.place is not None else None, "R", "shift", icons.REFRESH)
    yield Shortcut("Undo", _when_known(Undo(), "past"), "Z", "cmd/ctrl", icons.ARROW_BACK_UP)
    yield Shortcut("Redo", _when_known(Redo(), "future"), "Y", "cmd/ctrl", icons.ARROW_FORWARD_UP)
    for key, mode in enumerate(CameraMode, 1):
        yield Shortcut(f"Camera: {mode.value}", _see(mode), str(key), icon=icons.EYE)
    for name in scenes.names():
        yield Shortcut(f"Open {name}", _open(name), icon=icons.MAP_2)
    for name in PLANNERS:
        yield Shortcut(f"Planner: {name}", _choose("planner", name), icon=icons.ROUTE)
    for name in robots.names():
        yield Shortcut(f"Robot: {name}", _choose("robot", name), icon=icons.DRONE)


def _when_free(command: Command) -> Callable[[Session], Command | None]:
    return lambda session: command if session.may_begin else None


def _when_flying(command: Command) -> Callable[[Session], Command | None]:
    return lambda session: command if session.in_flight else None


def _when_known(command: Command, side: str) -> Callable[[Session], Command | None]:
    return lambda session: command if getattr(session.history, side) else None


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


def _see(mode: CameraMode) -> Callable[[Session], Command | None]:
    return lambda session: Adjust(Settings.VIEW, "camera", mode) if session.view_settings.camera is not mode else None


def _may_stop(session: Session) -> bool:
    """Check for a job that can be stopped; the first place must be opened."""
    return session.job is not None and (session.job.kind is not JobKind.OPEN or session.before is not None)


def _next_task(session: Session) -> Command | None:
    names = [task.name for task in session.place.tasks] if session.place is not None else []
    if not names:
        return None
    return ChooseTask(names[(names.index(session.task) + 1) % len(names) if session.task in names else 0])


def _open(name: str) -> Callable[[Session], Command | None]:
    return lambda session: OpenPlace(name) if session.what != name else None


def _choose(field: str, name: str) -> Callable[[Session], Command | None]:
    def ask(session: Session) -> Command | None:
        if session.place is None or getattr(session.choice, field) == name:
            return None
        return Choose(replace(session.choice, **{field: name}))

    return ask
