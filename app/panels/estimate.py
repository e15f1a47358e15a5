"""How the robot knows where it is, and how sure it is of that."""

from collections.abc import Callable

import numpy as np
import viser

from app.messages import Command, Settings
from app.panels.binding import Binder
from app.panels.charts import ErrorsChart
from app.panels.choice import ChoiceList
from app.records import FlightRecord
from app.registry import ESTIMATORS
from app.session import Session
from app.widgets import note, number, table
from nerfnav.estimator.belief import Belief
from nerfnav.navigation.steps import NavigationStep
from nerfnav.robots.state import ATTITUDE, POSITION, RigidState


class EstimatePanel:
    """The estimator, its numbers at the last time step, and its error over the flight."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """`post` takes what the user asks."""
        self._estimator = ChoiceList(server, "estimator", ESTIMATORS, "How the robot knows where it is", post)
        self._ellipsoid = server.gui.add_slider(
            "Ellipsoids ×", 1.0, 10.0, 0.5, 1.0, hint="Draw the 95 % regions larger than they are"
        )
        Binder(Settings.LOOK, post)(self._ellipsoid, "ellipsoid", float)
        self._numbers = server.gui.add_html(note("Opening…"))
        self._errors = ErrorsChart(server)

    def show(self, session: Session) -> None:
        """Show the estimate of the last time step."""
        self._estimator.show(session)
        self._ellipsoid.value = session.look.ellipsoid
        self._errors.show(session)
        self._numbers.content = describe(session.shown_flight)


def describe(flight: FlightRecord | None) -> str:
    """The numbers of the last time step, as HTML."""
    if flight is None or not flight.steps:
        return note("Nothing is estimated yet: press Fly, and the robot finds its way by its camera.")
    last = flight.steps[-1]
    error, deviation = last.truth.local(last.belief.mean), last.belief.covariance.diagonal().clamp_min(0).sqrt()
    rows = [
        ("Position error", number(100 * error[POSITION].norm().item(), "cm")),
        ("Standard deviations", _three(100 * deviation[POSITION].numpy(), "cm")),
        ("Attitude error", number(np.rad2deg(error[ATTITUDE].norm().item()), "°")),
        ("Standard deviations", _three(np.rad2deg(deviation[ATTITUDE].numpy()), "°")),
        ("NEES of the pose (6 where honest)", number(nees_of_pose(last.belief, last.truth), "")),
        *_of_update(last),
    ]
    words = last.update.outcome.value if last.update is not None and last.update.outcome is not None else ""
    return table(rows) + (note(f"{words[0].upper()}{words[1:]}.") if words else "")


def nees_of_pose(belief: Belief, truth: RigidState) -> float:
    """Squared error of position and attitude in units of what the covariance expects."""
    pose = np.r_[POSITION, ATTITUDE]
    error = belief.mean.local(truth).detach().double().numpy()[pose]
    covariance = belief.covariance.detach().double().numpy()[np.ix_(pose, pose)]
    return float(error @ np.linalg.solve(covariance, error))


def _of_update(step: NavigationStep) -> list[tuple[str, str]]:
    update = step.update
    if update is None:
        return []
    count = len(update.pixels)
    used = count if update.believed is None else int(update.believed.sum())
    return [
        ("Iterations", str(update.iteration + 1)),
        ("Pixels", f"{used} of {count}" if used < count else str(count)),
        ("Filter", number(step.filter_ms, "ms")),
    ]


def _three(values: np.ndarray, unit: str) -> str:
    return " · ".join(f"{value:.2g}" for value in values) + f" {unit}"
