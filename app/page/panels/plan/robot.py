"""Robot panel: show, change, use, save and load the numbers of the robot, each with its unit."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import viser

from nerfnav.core.errors import NerfnavError
from nerfnav.robots import Kind, RobotFile, describe_robot, robot_of, to_yaml
from nerfnav_app.page.kit.html import note, warning
from nerfnav_app.places.library import PlaceLibrary
from nerfnav_app.places.robot_library import MESHES, ROBOTS
from nerfnav_app.state.actions import Choose, Command, Tell
from nerfnav_app.state.robot_draft import (
    KINDS,
    NUMBERS,
    EditRobot,
    ForgetEdits,
    RobotNumber,
    box_of,
    edit_kind,
    make_cylinder,
    name_shape,
)
from nerfnav_app.state.session import Session
from nerfnav_app.text import sentence

_ICON = viser.Icon
_SHAPES = ("box", "cylinder")
"""Of bodies whose numbers can be changed here."""


class RobotPanel:
    """A widget for each number of the chosen robot, and what to do with them."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None], library: PlaceLibrary) -> None:
        """`post` takes what the user asks, `library` keeps the robots."""
        self._post, self._robots = post, library.robots
        self._chosen: str | None = None
        self._own: tuple[RobotFile, Path] | None = None
        self._session: Session | None = None
        self._checked: RobotFile | None = None
        self._problem = ""
        gui = server.gui
        with gui.add_folder("Robot in numbers", expand_by_default=False):
            self._name = gui.add_text("Robot name", "", hint="What you call it")
            self._kind: viser.GuiDropdownHandle[str] = gui.add_dropdown(
                "Kind", list(KINDS.values()), hint="How it moves: what another kind needs besides comes with it"
            )
            self._shape: viser.GuiDropdownHandle[str] = gui.add_dropdown("Body", list[str](_SHAPES))
            self._box = gui.add_vector3("Edges [m]", (0.1, 0.1, 0.1), step=0.001, hint="Length, width, height")
            self._radius = gui.add_number("Radius [m]", 0.1, step=0.001)
            self._height = gui.add_number("Height [m]", 0.1, step=0.001)
            self._numbers = {number: gui.add_number(number.label, 0.0, step=number.step) for number in NUMBERS}
            self._said = gui.add_html("")
            self._use = gui.add_button("Use this robot", icon=_ICON.CHECK, disabled=True)
            self._forget = gui.add_button("Forget changes", color="gray", icon=_ICON.ERASER, visible=False)
            self._save = gui.add_button("Save robot", color="gray", icon=_ICON.DOWNLOAD, hint="For --robot FILE")
            self._load = gui.add_upload_button(
                "Load robot", color="gray", icon=_ICON.UPLOAD, mime_type=",".join((*ROBOTS, *MESHES)),
                hint="A robot's file (.yaml); the mesh of its body is brought before it",
            )  # fmt: skip
        for number, widget in self._numbers.items():
            widget.on_update(partial(self._number, number))
        self._name.on_update(self._rename)
        self._kind.on_update(self._move_as)
        for widget in (self._shape, self._box, self._radius, self._height):
            widget.on_update(self._reshape)
        self._use.on_click(self._take)
        self._forget.on_click(self._drop)
        self._save.on_click(self._send)
        self._load.on_upload(self._bring)

    @property
    def _told(self) -> RobotFile | None:
        """What describes the robot now, changes included."""
        draft = None if self._session is None else self._session.robot_draft
        return draft if draft is not None or self._own is None else self._own[0]

    async def _number(self, number: RobotNumber, event: viser.GuiEvent[Any]) -> None:
        if event.client is not None and self._own is not None:
            self._post(number.edit(self._own[0], float(self._numbers[number].value)))

    async def _rename(self, event: viser.GuiEvent[Any]) -> None:
        if event.client is not None and self._own is not None:
            self._post(EditRobot(self._own[0], "", "name", str(self._name.value)))

    def _move_as(self, event: viser.GuiEvent[Any]) -> None:
        """Take another kind with what that needs; runs on a thread of the server's pool, for meshes are read."""
        told = self._told
        if event.client is None or self._own is None or told is None:
            return
        labels: dict[str, Kind] = {label: kind for kind, label in KINDS.items()}
        try:
            self._post(edit_kind(self._own[0], told, labels[str(self._kind.value)], self._own[1]))
        except NerfnavError as error:
            self._post(Tell("Not taken", sentence(str(error)), bad=True))
            self._kind.value = KINDS[told.kind]

    async def _reshape(self, event: viser.GuiEvent[Any]) -> None:
        if event.client is None or self._own is None:
            return
        own, shape = self._own[0].body, str(self._shape.value)
        if event.target in (self._radius, self._height):
            own = make_cylinder(own, float(self._radius.value), float(self._height.value))
        elif event.target is self._box or shape == "box":
            x, y, z = (float(edge) for edge in self._box.value)
            own = box_of(own, (x, y, z))
        elif shape == "cylinder":
            x, y, z = (float(edge) for edge in self._box.value)
            own = make_cylinder(own, round(0.5 * max(x, y), 4), z)
        self._post(EditRobot(self._own[0], "", "body", own))  # else as in its file

    async def _drop(self, event: viser.GuiEvent[Any]) -> None:
        if event.client is not None:
            self._post(ForgetEdits())

    def _take(self, event: viser.GuiEvent[Any]) -> None:
        """Write the robot's file and choose it; runs on a thread of the server's pool."""
        told = self._told
        if event.client is not None and told is not None and self._own is not None:
            meshes = self._own[1]
            self._choose(lambda: self._robots.keep(told, meshes))

    def _bring(self, event: viser.GuiEvent[Any]) -> None:
        """Keep what was brought, and choose it where it is a robot; runs on a thread of the server's pool."""
        brought = self._load.value
        self._choose(lambda: self._robots.brought(brought.name, brought.content))

    def _choose(self, keep: Callable[[], Path | None]) -> None:
        try:
            file = keep()
        except NerfnavError as error:
            self._post(Tell("Not taken", sentence(str(error)), bad=True))
            return
        if file is None:
            self._post(Tell("Kept", "Now bring the robot's file, which names it."))
        elif self._session is not None:
            self._post(Choose(replace(self._session.choice, robot=str(file))))

    def _send(self, event: viser.GuiEvent[Any]) -> None:
        """Send the robot's file to the tab that asks; runs on a thread of the server's pool."""
        told = self._told
        if event.client is not None and told is not None:
            event.client.send_file_download(f"{told.name}.yaml", to_yaml(told), save_immediately=True)

    def show(self, session: Session) -> None:
        """Show the numbers of the chosen robot, or those that are being changed."""
        self._session = session
        if session.choice.robot != self._chosen:
            self._chosen = session.choice.robot
            self._own = _described(self._chosen)
        told = self._told
        if told is None:
            self._said.content = note("Nothing describes this robot any more: its file is gone.")
            return
        if told is not self._checked:
            self._fill(told)
            self._checked, self._problem = told, "" if self._own is None else problem_of(told, self._own[1])
        changed = session.robot_draft is not None
        self._said.content = warning(self._problem) if self._problem else note(
            "Changed: the robot is as before until you use this one." if changed else "As it is chosen."
        )
        self._use.disabled = not changed or bool(self._problem) or session.place is None
        self._forget.visible = changed

    def _fill(self, told: RobotFile) -> None:
        """Put the numbers into the widgets."""
        shape, body = name_shape(told.body), told.body
        shapes = _SHAPES if self._own is None else tuple(dict.fromkeys((*_SHAPES, name_shape(self._own[0].body))))
        if self._shape.options != shapes:
            self._shape.options = shapes
        self._name.value, self._kind.value, self._shape.value = told.name, KINDS[told.kind], shape
        self._box.visible, self._radius.visible = body.box is not None, body.cylinder is not None
        self._height.visible = body.cylinder is not None
        if body.box is not None:
            self._box.value = body.box
        if body.cylinder is not None:
            self._radius.value, self._height.value = body.cylinder.radius, body.cylinder.height
        for number, widget in self._numbers.items():
            value = number.of(told)
            widget.visible = value is not None
            if value is not None:
                widget.value = value


def problem_of(told: RobotFile, folder: Path) -> str:
    """Why there can be no such robot here, in one sentence; empty where there can."""
    try:
        robot_of(told, folder).require_planned()
    except NerfnavError as error:
        return sentence(str(error).replace(f"{folder}/", ""))
    return ""


def _described(robot: str) -> tuple[RobotFile, Path] | None:
    """What describes a robot, and where its meshes lie; None where nothing does, such as a file that was deleted."""
    try:
        return describe_robot(robot)
    except NerfnavError:
        return None
