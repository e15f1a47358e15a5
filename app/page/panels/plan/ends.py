"""Start and goal in numbers, and the scene's tasks."""

import time
from collections.abc import Callable

import numpy as np
import viser

from nerfnav_app.page.kit.html import fine, note, warning
from nerfnav_app.page.kit.widgets import post_on
from nerfnav_app.places.ends import End, EndRole
from nerfnav_app.places.place import Place
from nerfnav_app.state.actions import AimEnd, ChooseTask, Command, MoveEnd, TypeEnd
from nerfnav_app.state.session import Session
from nerfnav_app.text import capital, sentence

_BY_HAND = "custom"
_HELD_S = 0.25
"""Interval of updates of the numbers during a drag [s]: forms cost a browser more than the plan that follows."""


class EndsPanel:
    """Panel of the task, and the position and heading of each end."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """Add the widgets; `post` takes the commands."""
        self._updated_at = 0.0
        self._tasks: dict[str, str] = {}
        self._task: viser.GuiDropdownHandle[str] = server.gui.add_dropdown(
            "Task", list[str]([_BY_HAND]), hint="Start and goal of a task of this scene"
        )
        self._numbers = {which: _EndNumbers(server, which, post) for which in EndRole}
        self._aim = server.gui.add_button_group(
            "Click to place", tuple(which.value for which in EndRole), hint="Then click into the scene"
        )
        self._status = server.gui.add_html(note("Opening…"))
        self._offers = {which: _Offer(server, which, post) for which in EndRole}
        post_on(self._task.on_update, post, self._chosen)
        post_on(self._aim.on_click, post, lambda: AimEnd(EndRole(self._aim.value)))

    def _chosen(self) -> ChooseTask | None:
        name = self._tasks.get(self._task.value)
        return None if name is None else ChooseTask(name)

    def show(self, session: Session) -> None:
        """Copy the session's numbers into the widgets."""
        place = session.place
        for widget in (self._task, self._aim, *self._numbers.values()):
            widget.visible = place is not None
        if place is None:
            self._status.content = note("Opening…")
            for offer in self._offers.values():
                offer.show(None)
            return
        self._tasks = titles(place)
        if self._task.options != (_BY_HAND, *self._tasks):
            self._task.options = (_BY_HAND, *self._tasks)
        self._task.value = next((title for title, name in self._tasks.items() if name == session.task), _BY_HAND)
        if not session.held or time.monotonic() - self._updated_at > _HELD_S:
            self._updated_at = time.monotonic()
            for which, numbers in self._numbers.items():
                numbers.show(session.outside.get(which) or session.ends.of(which))
        self._status.content = describe(session)
        for which, offer in self._offers.items():
            offer.show(session.offers.get(which))


def titles(place: Place) -> dict[str, str]:
    """Map the label of each task of a place to its name: the robot's own first, others with their robot."""
    own = {task.name: task.name for task in place.tasks if task.robot == place.robot.name}
    return own | {f"{task.name} ({task.robot})": task.name for task in place.tasks if task.robot != place.robot.name}


def describe(session: Session) -> str:
    """Describe the state of the ends as HTML."""
    if session.seeking:
        return note("Searching for start and goal…")
    if isinstance(session.aiming, EndRole):
        return note(f"Click into the scene to place the {session.aiming.value}.")
    if session.outside:
        return note("The typed numbers are outside of the place: correct them, or drag the end.")
    problems = [f"{which.value}: {text}" for which, text in session.problems.items() if text is not None]
    if problems:
        return warning(" ".join(map(sentence, problems)))
    if len(session.problems) < len(EndRole):
        return note("Checking that the robot fits…")
    start, goal = (np.array(session.ends.of(which).position) for which in EndRole)
    return fine(f"The robot fits at both ends, {np.linalg.norm(goal - start):.2f} m apart.")


class _Offer:
    """Button that moves an end to the nearest free pose; hidden while the robot fits."""

    def __init__(self, server: viser.ViserServer, which: EndRole, post: Callable[[Command], None]) -> None:
        self._end: End | None = None
        self._button = server.gui.add_button(
            f"Move the {which.value} to the nearest free point", color="gray", icon=viser.Icon.MAGNET, visible=False
        )
        post_on(self._button.on_click, post, lambda: None if self._end is None else MoveEnd(which, self._end))

    def show(self, end: End | None) -> None:
        self._end = end
        self._button.visible = end is not None


class _EndNumbers:
    """Number fields of one end: position and heading."""

    def __init__(self, server: viser.ViserServer, which: EndRole, post: Callable[[Command], None]) -> None:
        self._which = which
        name = capital(which.value)
        self._position = server.gui.add_vector3(
            f"{name} [m]", (0.0, 0.0, 0.0), step=0.01, hint=f"x, y, z of the {which.value} in the world"
        )
        self._yaw = server.gui.add_number(f"{name} yaw [°]", 0.0, step=1.0, hint="Heading; 0 points along x")
        post_on(self._position.on_update, post, self._typed)
        post_on(self._yaw.on_update, post, self._typed)

    def _typed(self) -> TypeEnd:
        x, y, z = (float(value) for value in self._position.value)
        return TypeEnd(self._which, End((x, y, z), float(np.deg2rad(self._yaw.value))))

    @property
    def visible(self) -> bool:
        """Visibility of the numbers."""
        return self._position.visible

    @visible.setter
    def visible(self, visible: bool) -> None:
        self._position.visible = self._yaw.visible = visible

    def show(self, end: End) -> None:
        self._position.value = end.position
        self._yaw.value = round(float(np.rad2deg(end.yaw)), 2)
