"""Flight panel: pause, step and push a flight, its numbers, and the settings of the next one.

The settings are seed, noise, world, speed and open loop.
"""

from collections.abc import Callable

import numpy as np
import viser

from nerfnav.navigation import EpisodeOutcome, NavigateConfig, WorldName
from nerfnav.robots import ATTITUDE, POSITION
from nerfnav_app.page.kit.chart import TIMES, FlightChart
from nerfnav_app.page.kit.html import caution, fine, note, table, warning
from nerfnav_app.page.kit.widgets import Binder, post_on
from nerfnav_app.state.actions import Command, Gust, Pause, Resume, Settings, StepOnce
from nerfnav_app.state.flight import LARGEST_SEED, FlightRecord
from nerfnav_app.state.session import Session
from nerfnav_app.text import number, sentence

_SPEEDS = {"as fast as it can": 0.0, "real time": 1.0, "half": 0.5, "a quarter": 0.25}

_WORLDS: dict[str, WorldName] = {"the paper's noise": "paper", "wind and motors": "physical"}


class FlightSettingsWidgets:
    """Widgets of `FlightSettings`, in a folder."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """Add the widgets; `post` takes the commands."""
        with server.gui.add_folder("Settings", expand_by_default=False):
            self._speed: viser.GuiDropdownHandle[str] = server.gui.add_dropdown(
                "Speed", list[str](_SPEEDS), hint="Takes effect at once, in flight too"
            )
            self._world: viser.GuiDropdownHandle[str] = server.gui.add_dropdown(
                "World", list[str](_WORLDS), hint="Wind and motors: a quadrotor of 250 g in 2 m/s of wind"
            )
            self._realtime = server.gui.add_checkbox(
                "Real time (late steps)",
                False,
                hint="The world goes on while filter and planner compute: a step can be late",
            )
            self._seed = server.gui.add_number(
                "Seed", 0, min=0, max=LARGEST_SEED, step=1, hint="Of the noise and the initial belief"
            )
            self._position = server.gui.add_slider(
                "Position noise per step [cm]", 0.0, 10.0, 0.5, 2.0, hint="Standard deviation along each axis"
            )
            self._attitude = server.gui.add_slider(
                "Attitude noise per step [°]", 0.0, 10.0, 0.1, 1.1, hint="Standard deviation about each axis"
            )
            self._open_loop = server.gui.add_checkbox(
                "Open loop", False, hint="Fly the first plan without filter and replanning"
            )
        bind = Binder(Settings.FLIGHT, post)
        bind(self._speed, "pace", _SPEEDS.__getitem__)
        bind(self._world, "world", _WORLDS.__getitem__)
        bind(self._realtime, "realtime", bool)
        bind(self._seed, "seed", round)
        bind(self._position, "position_noise_m", lambda value: 0.01 * float(value))
        bind(self._attitude, "attitude_noise_rad", lambda value: float(np.deg2rad(value)))
        bind(self._open_loop, "open_loop", bool)

    def show(self, session: Session) -> None:
        """Copy the session's settings into the widgets."""
        settings = session.flight_settings
        self._speed.value = next((name for name, pace in _SPEEDS.items() if pace == settings.pace), self._speed.value)
        self._world.value = next(name for name, world in _WORLDS.items() if world == settings.world)
        self._realtime.value = settings.realtime
        self._position.disabled = self._attitude.disabled = settings.world == "physical"
        self._seed.value = settings.seed
        self._position.value = round(100 * settings.position_noise_m, 2)
        self._attitude.value = round(float(np.rad2deg(settings.attitude_noise_rad)), 1)
        self._open_loop.value = settings.open_loop


class FlightPanel:
    """Panel of a flight: buttons, settings, numbers and charts."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """Add the widgets; `post` takes the commands."""
        self._steer = server.gui.add_button_group("Flight", ("Pause", "Step"), visible=False)
        self._gust = server.gui.add_button(
            "Gust", color="gray", icon=viser.Icon.WIND, visible=False, hint="Push the robot once"
        )
        self._settings = FlightSettingsWidgets(server, post)
        self._numbers = server.gui.add_html("")
        self._times = FlightChart(server, TIMES)
        commands = {"Pause": Pause(), "Resume": Resume(), "Step": StepOnce()}
        post_on(self._gust.on_click, post, Gust)
        post_on(self._steer.on_click, post, lambda: commands.get(self._steer.value))

    def show(self, session: Session) -> None:
        """Show the flight as far as it has gone."""
        job, flying = session.job, session.in_flight
        self._steer.visible = self._gust.visible = flying
        self._settings.show(session)
        self._times.show(session)
        if job is not None:
            self._steer.options = ("Resume" if job.paused else "Pause", "Step")
        self._numbers.content = describe(
            session.shown_flight, session.flight_is_stale, flying, old=session.flight_outdated_by
        )


def describe(flight: FlightRecord | None, stale: bool, flying: bool, old: str = "") -> str:
    """Format the numbers of a flight as HTML; `stale` after its ends were moved, `old` names what was replaced."""
    if flight is None or not flight.steps:
        return note("Planning…" if flying else "No flight yet. Press Fly: the robot flies by its camera alone.")
    last = flight.steps[-1]
    error = last.truth.local(last.belief.mean)
    deviation = last.belief.covariance.diagonal()[POSITION].sum().sqrt().item()
    rows = [
        ("Time", number(last.time, "s")),
        ("Position error", number(100 * error[POSITION].norm().item(), "cm")),
        ("Standard deviation", number(100 * deviation, "cm"), "Root of the trace of the position covariance"),
        ("Attitude error", number(np.rad2deg(error[ATTITUDE].norm().item()), "°")),
        ("Filter", number(last.filter_ms, "ms")),
        ("Replanning", number(last.replan_ms, "ms")),
        ("Late steps", str(sum(step.late for step in flight.steps)), "Computed longer than a step lasts"),
        ("Steps in collision", str(sum(step.touched for step in flight.steps)), "With the ground-truth mesh"),
    ]
    outcome = "" if flight.outcome is None else format_landing(flight)(_describe_outcome(flight))
    if not outcome and not flying:
        outcome = note("Stopped before the goal.")
    mark = caution(f"These are the numbers of the flight with the old {old}.") if old else ""
    remark = warning("Start, goal or obstacles have moved since this flight.") if stale else ""
    return mark + table(rows) + outcome + remark


def has_arrived(flight: FlightRecord) -> bool:
    """Check whether a flight ended with the true robot at the goal."""
    return flight.outcome is EpisodeOutcome.REACHED and distance_to_goal(flight) < NavigateConfig.goal_tolerance_m


def format_landing(flight: FlightRecord) -> Callable[[str], str]:
    """Choose the format of how a flight ended: amber where the robot only believes to have arrived."""
    if flight.outcome is not EpisodeOutcome.REACHED:
        return warning
    return fine if has_arrived(flight) else caution


def distance_to_goal(flight: FlightRecord) -> float:
    """Compute the distance of the true robot from the goal [m]."""
    return (flight.steps[-1].truth.position - flight.ends.goal.state().position).norm().item()


def _describe_outcome(flight: FlightRecord) -> str:
    assert flight.outcome is not None, "only a flight that has ended has an outcome"
    if flight.outcome is EpisodeOutcome.REACHED and not has_arrived(flight):
        return f"The robot believes to be at the goal, {100 * distance_to_goal(flight):.0f} cm away."
    return sentence(flight.outcome.value)
