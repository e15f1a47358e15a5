"""Estimate panel: the estimator, and the estimated pose with its covariance in texts, numbers and charts."""

from collections.abc import Callable

import numpy as np
import viser

from nerfnav.estimator import Belief, RelocaliseOutcome, estimators
from nerfnav.geometry.so3 import yaw_of
from nerfnav.navigation import NavigationStep, SupervisorAction
from nerfnav.robots import ATTITUDE, POSITION, RigidState
from nerfnav_app.page.kit.chart import ERRORS, FlightChart
from nerfnav_app.page.kit.html import columns, fine, note, table, warning
from nerfnav_app.page.kit.widgets import Binder, ChoiceList, post_on
from nerfnav_app.page.layers.global_localization import MOST_CANDIDATES
from nerfnav_app.state.actions import Command, FindRobot, KidnapRobot, Settings
from nerfnav_app.state.flight import FlightRecord, LocalizationRecord
from nerfnav_app.state.session import Session
from nerfnav_app.text import number, sentence


def describe(flight: FlightRecord | None) -> str:
    """Format the numbers of the last time step as HTML."""
    if flight is None or not flight.steps:
        return note("No estimate yet. Press Fly: the filter estimates the pose from the camera.")
    last = flight.steps[-1]
    error, deviation = last.truth.local(last.belief.mean), last.belief.covariance.diagonal().clamp_min(0).sqrt()
    nees = nees_of_pose(last.belief, last.truth)
    rows = [
        ("Position error", number(100 * error[POSITION].norm().item(), "cm")),
        ("Std. dev. x · y · z", _three(100 * deviation[POSITION].numpy(), "cm"), "Of the estimated position"),
        ("Attitude error", number(np.rad2deg(error[ATTITUDE].norm().item()), "°")),
        (
            "Std. dev. about x · y · z",
            _three(np.rad2deg(deviation[ATTITUDE].numpy()), "°"),
            "Of the estimated attitude",
        ),
        (
            "Error / std. dev. (1 expected)",
            f"{max(nees / 6, 0.0) ** 0.5:.2g}",
            f"Root of NEES / 6; NEES of the pose: {nees:.3g}",
        ),
        *_of_update(last),
    ]
    outcome = last.update.outcome.value if last.update is not None else ""
    return table(rows) + (note(sentence(outcome)) if outcome else "") + _of_recovery(last)


def _of_recovery(step: NavigationStep) -> str:
    if step.recovery is None:
        return ""
    say = fine if step.recovery is SupervisorAction.RELOCALISED else warning
    reason = "" if step.change is None else note(sentence(step.change.reason))
    return say(sentence(step.recovery.value)) + reason


def describe_candidates(search: LocalizationRecord) -> str:
    """Format the likeliest poses of a global localization as HTML."""
    step, outcome = search.step, search.outcome
    if outcome is None:
        return note(f"{len(step.weights)} candidate poses left.")
    if outcome is RelocaliseOutcome.LOST:  # none looks like the picture: their shares mean nothing
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
    return say(sentence(outcome.value)) + columns(("", "position [m]", "heading", "probability"), rows)


def nees_of_pose(belief: Belief, truth: RigidState) -> float:
    """Compute the normalized estimation error squared (NEES) of position and attitude."""
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


def _three(values: np.ndarray, unit: str) -> str:
    return " · ".join(f"{value:.2g}" for value in values) + f" {unit}"


def explain_no_search(session: Session) -> str:
    """Explain why the robot cannot be localized globally now; nothing where it can."""
    if session.last_picture is None:
        return "Find the robot needs a camera picture: fly first."
    return "" if session.may_find else "Find the robot has to wait until the running job has ended."


class EstimatePanel:
    """Panel of the estimator, its numbers at the last time step, and its error over the flight."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """Add the widgets; `post` takes the commands."""
        self._estimator = ChoiceList(
            server,
            "estimator",
            estimators.names(),
            "Filter that estimates the pose; paper: as in the paper, slow",
            post,
        )
        self._ellipsoid = server.gui.add_slider("Ellipsoid scale", 1.0, 10.0, 0.5, 1.0, hint="1 draws the 95 % regions")
        Binder(Settings.VIEW, post)(self._ellipsoid, "ellipsoid", float)
        self._find = server.gui.add_button(
            "Find the robot", icon=viser.Icon.MAP_SEARCH, disabled=True,
            hint="Global localization: compare its last picture with the whole field, without a prior",
        )  # fmt: skip
        self._reason = server.gui.add_html("", visible=False)
        self._kidnap = server.gui.add_button(
            "Kidnap the robot", color="gray", icon=viser.Icon.HAND_GRAB, visible=False,
            hint="Move the flying robot to another pose, without a report to its filter",
        )  # fmt: skip
        self._found = server.gui.add_html("", visible=False)
        self._numbers = server.gui.add_html(note("Opening…"))
        self._errors = FlightChart(server, ERRORS)
        post_on(self._find.on_click, post, FindRobot)
        post_on(self._kidnap.on_click, post, KidnapRobot)

    def show(self, session: Session) -> None:
        """Show the estimate of the last time step."""
        self._estimator.show(session)
        self._ellipsoid.value = session.view_settings.ellipsoid
        self._errors.show(session)
        self._find.disabled = not session.may_find
        # browsers show no hint of a button that is disabled
        self._reason.content, self._reason.visible = note(explain_no_search(session)), not session.may_find
        self._kidnap.visible = session.in_flight
        self._found.visible = session.search is not None
        if session.search is not None:
            self._found.content = describe_candidates(session.search)
        self._numbers.visible = session.track is None
        self._numbers.content = describe(session.shown_flight)
