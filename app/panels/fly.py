"""Fly, hold and step, and see what the robot sees beside what it believes to see."""

from collections.abc import Callable

import numpy as np
import viser

from app.messages import Cancel, Command, Pause, Resume, StartFlight, StepOnce, View
from app.panels.choice import ChoiceList
from app.records import FlightRecord
from app.registry import ESTIMATORS
from app.session import JobKind, Session
from app.widgets import note, number, table, warning
from nerfnav.navigation.steps import NavigationStep
from nerfnav.robots.state import ATTITUDE, POSITION

_GAP = 6  # [pixels] between the two pictures
_DARK = 30  # level of grey of the gap
_ROBOT_AND_FIELD = "Left: the robot's camera. Right: the field, seen from where the robot believes to be."
_FROM_THE_ENDS = "The field as the robot would see it from the start (left) and from the goal (right)."


class FlyPanel:
    """The buttons, the two pictures, and the numbers of the flight."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """`post` takes what the user asks."""
        self._post = post
        self._estimator = ChoiceList(server, "estimator", ESTIMATORS, "How the robot knows where it is", post)
        self._fly = server.gui.add_button("Fly", icon=viser.Icon.DRONE, disabled=True)
        self._steer = server.gui.add_button_group("Flight", ("Pause", "Step", "Stop"), visible=False)
        self._caption = server.gui.add_html(note("Opening…"))
        self._picture = server.gui.add_image(np.full((2, 4, 3), _DARK, np.uint8), jpeg_quality=85, visible=False)
        self._numbers = server.gui.add_html("")
        self._pictured: tuple[int, int] | None = None

        @self._fly.on_click
        async def _(_: viser.GuiEvent) -> None:
            post(StartFlight())

        @self._steer.on_click
        async def _(event: viser.GuiEvent) -> None:
            commands = {"Pause": Pause(), "Resume": Resume(), "Step": StepOnce(), "Stop": Cancel()}
            if event.target.value in commands:
                post(commands[event.target.value])

    def show(self, session: Session) -> None:
        """Show the flight as far as it is."""
        self._estimator.show(session)
        job = session.job
        flying = job is not None and job.kind is JobKind.FLY
        self._fly.disabled = session.place is None or job is not None
        self._fly.visible, self._steer.visible = not flying, flying
        if job is not None:
            self._steer.options = ("Resume" if job.paused else "Pause", "Step", "Stop")
        self._numbers.content = describe(session.flight, session.flight_is_stale, flying)
        self._look(session)

    def _look(self, session: Session) -> None:
        view = session.view
        if view is None:
            return
        step = step_of(view, session.flight)
        image = step.image.numpy() if step is not None and step.image is not None else None
        if self._pictured != (id(view), id(image)):
            self._pictured = id(view), id(image)
            self._caption.content = note(_ROBOT_AND_FIELD if image is not None else _FROM_THE_ENDS)
            self._picture.image = beside(*view.images) if image is None else beside(image, *view.images)
            self._picture.visible = True


def step_of(view: View, flight: FlightRecord | None) -> NavigationStep | None:
    """The time step of the flight that the view is of."""
    kind, *key = view.question.key
    if kind != "flight" or flight is None or not 0 < key[-1] <= len(flight.steps):
        return None
    return flight.steps[key[-1] - 1]


def beside(*images: np.ndarray) -> np.ndarray:
    """Pictures (h, w, 3) side by side, as high as the highest."""
    height = max(image.shape[0] for image in images)
    columns = [
        np.pad(image, ((0, height - image.shape[0]), (0, _GAP), (0, 0)), constant_values=_DARK) for image in images
    ]
    return np.concatenate(columns, axis=1)[:, :-_GAP]


def describe(flight: FlightRecord | None, stale: bool, flying: bool) -> str:
    """The numbers of a flight, as HTML."""
    if flight is None or not flight.steps:
        return note(
            "Planning the way…" if flying else "Not flown yet: press Fly, and the robot goes by its camera alone."
        )
    last = flight.steps[-1]
    error = last.truth.local(last.belief.mean)
    deviation = last.belief.covariance.diagonal()[POSITION].sum().sqrt().item()
    rows = [
        ("Time", number(last.time, "s")),
        ("Position error", number(100 * error[POSITION].norm().item(), "cm")),
        ("Expected from the covariance", number(100 * deviation, "cm")),
        ("Attitude error", number(np.rad2deg(error[ATTITUDE].norm().item()), "°")),
        ("Filter", number(last.filter_ms, "ms")),
        ("Replanning", number(last.replan_ms, "ms")),
        ("Steps that touched the mesh", str(sum(step.touched for step in flight.steps))),
    ]
    words = flight.outcome.value.capitalize() + "." if flight.outcome is not None else ""
    if not words and not flying:
        words = "Stopped on the way."
    remark = warning("Start or goal have moved since: this flight was between the earlier ones.") if stale else ""
    return table(rows) + (note(words) if words else "") + remark
