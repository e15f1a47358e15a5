"""Estimate panel: the estimator, and the estimated pose with its covariance, in words, numbers and charts."""


from collections.abc import Callable

import numpy as np
import viser

from nerfnav.estimator import Belief, RelocaliseOutcome, estimators
from nerfnav.geometry.so3 import yaw_of
from nerfnav.navigation import NavigationStep, SupervisorState
from nerfnav.robots import ATTITUDE, POSITION, RigidState
from nerfnav_app.page.kit.html import columns, fine, note, table, warning
from nerfnav_app.page.kit.widgets import Binder, ChoiceList
from nerfnav_app.page.layers.global_localization import MOST_CANDIDATES
from nerfnav_app.page.panels.flight.flight_charts import ERRORS, FlightChart
from nerfnav_app.state.actions import Command, FindRobot, KidnapRobot, Settings
from nerfnav_app.state.records import FlightRecord, LocalizationRecord
from nerfnav_app.state.session import Session
from nerfnav_app.text import number, sentence


def describe(flight: FlightRecord | None) -> str:
    """The numbers of the last time step, as HTML."""
    if flight is None or not flight.steps:
        return note("Nothing is estimated yet: press Fly it, and the robot finds its way by its camera.")
    last = flight.steps[-1]
    error, deviation = last.truth.local(last.belief.mean), last.belief.covariance.diagonal().clamp_min(0).sqrt()
    nees = nees_of_pose(last.belief, last.truth)
    rows = [
        ("Position error", number(100 * error[POSITION].norm().item(), "cm")),
        ("Expected along x · y · z", _three(100 * deviation[POSITION].numpy(), "cm"), "Standard deviations"),
        ("Attitude error", number(np.rad2deg(error[ATTITUDE].norm().item()), "°")),
        ("Expected about x · y · z", _three(np.rad2deg(deviation[ATTITUDE].numpy()), "°"), "Standard deviations"),
        ("Error against expectation", _times(nees), f"NEES of the pose: {nees:.3g}; 6 on average where it is honest"),
        *_of_update(last),
    ]
    words = last.update.outcome.value if last.update is not None else ""
    return table(rows) + (note(sentence(words)) if words else "") + _of_recovery(last)


def _of_recovery(step: NavigationStep) -> str:
    if step.recovery is None:
        return ""
    say = fine if step.recovery is SupervisorState.RELOCALISED else warning
    return say(sentence(step.recovery.value))


def found(search: LocalizationRecord) -> str:
    """The likeliest places of a search, as HTML."""
    step, outcome = search.step, search.outcome
    if outcome is None:
        return note(f"{len(step.weights)} places are left to compare.")
    if outcome is RelocaliseOutcome.LOST:  # the shares among places that all look otherwise say nothing
        return warning(sentence(outcome.value))
    poses = step.body_poses()
    rows = [
        (
            str(index + 1),
            ", ".join(f"{value:.2f}" for value in poses.position[index].tolist()),
            f"{np.rad2deg(yaw_of(poses.rotation[index]).item()):.0f}°",
            f"{100 * step.weights[index].item():.0f} %",
        )
        for index in range(min(len(step.weights), MOST_CANDIDATES))
    ]
    say = fine if outcome is RelocaliseOutcome.FOUND else warning
    return say(sentence(outcome.value)) + columns(("", "place [m]", "heading", "likely"), rows)


def nees_of_pose(belief: Belief, truth: RigidState) -> float:
    """Squared error of position and attitude in units of what the covariance expects."""
    pose = np.r_[POSITION, ATTITUDE]
    error = belief.mean.local(truth).detach().double().numpy()[pose]
    covariance = belief.covariance.detach().double().numpy()[np.ix_(pose, pose)]
    return float(error @ np.linalg.solve(covariance, error))


def _of_update(step: NavigationStep) -> list[tuple[str, str]]:
    if step.update is None:
        return []
    update = step.update.step
    count = len(update.pixels)
    used = count if update.believed is None else int(update.believed.sum())
    return [
        ("Iterations", str(update.iteration + 1)),
        ("Pixels", f"{used} of {count}" if used < count else str(count)),
        ("Filter", number(step.filter_ms, "ms")),
    ]


def _times(nees: float) -> str:
    """How many times as large the error of the pose is as the covariance expects: the root of its mean square."""
    return f"{max(nees / 6, 0.0) ** 0.5:.2g} × as expected"


def _three(values: np.ndarray, unit: str) -> str:
    return " · ".join(f"{value:.2g}" for value in values) + f" {unit}"


class EstimatePanel:
    """The estimator, its numbers at the last time step, and its error over the flight."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """`post` takes what the user asks."""
        self._estimator = ChoiceList(server, "estimator", estimators.names(), "How the robot knows where it is", post)
        self._ellipsoid = server.gui.add_slider(
            "Ellipsoids ×", 1.0, 10.0, 0.5, 1.0, hint="Draw the 95 % regions larger than they are"
        )
        Binder(Settings.VIEW, post)(self._ellipsoid, "ellipsoid", float)
        self._find = server.gui.add_button(
            "Find the robot", icon=viser.Icon.MAP_SEARCH, disabled=True,
            hint="Look for it everywhere by its last picture alone, as if nothing were known",
        )  # fmt: skip
        self._carry = server.gui.add_button(
            "Put it elsewhere", color="gray", icon=viser.Icon.HAND_GRAB, visible=False,
            hint="Kidnapped robot: the flying robot is put down somewhere else, without being told",
        )  # fmt: skip
        self._found = server.gui.add_html("", visible=False)
        self._numbers = server.gui.add_html(note("Opening…"))
        self._errors = FlightChart(server, ERRORS)

        @self._find.on_click
        async def _(_: viser.GuiEvent) -> None:
            post(FindRobot())

        @self._carry.on_click
        async def _(_: viser.GuiEvent) -> None:
            post(KidnapRobot())

    def show(self, session: Session) -> None:
        """Show the estimate of the last time step."""
        self._estimator.show(session)
        self._ellipsoid.value = session.view_settings.ellipsoid
        self._errors.show(session)
        self._find.disabled = not session.may_find
        self._carry.visible = session.in_flight
        self._found.visible = session.search is not None
        if session.search is not None:
            self._found.content = found(session.search)
        self._numbers.visible = session.track is None
        self._numbers.content = describe(session.shown_flight)
