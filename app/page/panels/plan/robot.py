"""Robot panel: show, edit, use, save and load the numbers of the robot, each with its unit."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import viser

from nerfnav.core.errors import NerfnavError
from nerfnav.robots import Kind, RobotFile, describe_robot, robot_of, to_yaml
from nerfnav_app.page.kit.html import note, warning
from nerfnav_app.page.kit.widgets import post_on
from nerfnav_app.places.library import PlaceLibrary
from nerfnav_app.places.robot_library import MESHES, ROBOTS
from nerfnav_app.state.actions import Choose, Command, Notify
from nerfnav_app.state.robot_draft import (
    KINDS,
    NUMBERS,
    DiscardEdits,
    EditRobot,
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
"""Shapes of bodies that can be edited here."""


class RobotPanel:
    """Panel of the robot: a widget for each number, and buttons to apply, save and load them."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None], library: PlaceLibrary) -> None:
        """Add the widgets; `post` takes the commands, `library` stores the robots."""
        self._post, self._robots = post, library.robots
        self._chosen: str | None = None
        self._own: tuple[RobotFile, Path] | None = None
        self._session: Session | None = None
        self._checked: RobotFile | None = None
        self._problem = ""
        gui = server.gui
        with gui.add_folder("Robot parameters", expand_by_default=False):
            self._name = gui.add_text("Robot name", "", hint="Name of the robot")
            self._kind: viser.GuiDropdownHandle[str] = gui.add_dropdown(
                "Kind", list(KINDS.values()), hint="Kind of motion; another kind brings the parameters that it needs"
            )
            self._shape: viser.GuiDropdownHandle[str] = gui.add_dropdown("Body", list[str](_SHAPES))
            self._box = gui.add_vector3("Edges [m]", (0.1, 0.1, 0.1), step=0.001, hint="Length, width, height")
            self._radius = gui.add_number("Radius [m]", 0.1, step=0.001)
            self._height = gui.add_number("Height [m]", 0.1, step=0.001)
            self._numbers = {number: gui.add_number(number.label, 0.0, step=number.step) for number in NUMBERS}
            self._status = gui.add_html("")
            self._use = gui.add_button("Use this robot", icon=_ICON.CHECK, disabled=True)
            self._discard = gui.add_button("Discard edits", color="gray", icon=_ICON.ERASER, visible=False)
            self._save = gui.add_button(
                "Save robot", color="gray", icon=_ICON.DOWNLOAD, hint="As a file for --robot FILE"
            )
            self._load = gui.add_upload_button(
                "Load robot", color="gray", icon=_ICON.UPLOAD, mime_type=",".join((*ROBOTS, *MESHES)),
                hint="A robot file (.yaml); load the mesh of its body first",
            )  # fmt: skip
        for number, widget in self._numbers.items():
            post_on(widget.on_update, post, partial(self._set, number))
        post_on(self._name.on_update, post, self._rename)
        self._kind.on_update(self._move_as)
        for widget in (self._shape, self._box, self._radius, self._height):
            widget.on_update(self._reshape)
        self._use.on_click(self._take)
        post_on(self._discard.on_click, post, DiscardEdits)
        self._save.on_click(self._send)
        self._load.on_upload(self._bring)

    @property
    def _edited(self) -> RobotFile | None:
        """The robot's file with its edits."""
        draft = None if self._session is None else self._session.robot_draft
        return draft if draft is not None or self._own is None else self._own[0]

    def _set(self, number: RobotNumber) -> EditRobot | None:
        return None if self._own is None else number.edit(self._own[0], float(self._numbers[number].value))

    def _rename(self) -> EditRobot | None:
        return None if self._own is None else EditRobot(self._own[0], "", "name", str(self._name.value))

    def _move_as(self, event: viser.GuiEvent[Any]) -> None:
        """Change the kind; runs on a thread of the server's pool, as meshes are read."""
        robot = self._edited
        if event.client is None or self._own is None or robot is None:
            return
        labels: dict[str, Kind] = {label: kind for kind, label in KINDS.items()}
        try:
            self._post(edit_kind(self._own[0], robot, labels[str(self._kind.value)], self._own[1]))
        except NerfnavError as error:
            self._post(Notify("Not applied", sentence(str(error)), bad=True))
            self._kind.value = KINDS[robot.kind]

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

    def _take(self, event: viser.GuiEvent[Any]) -> None:
        """Write the robot's file and select it; runs on a thread of the server's pool."""
        robot = self._edited
        if event.client is not None and robot is not None and self._own is not None:
            meshes = self._own[1]
            self._choose(lambda: self._robots.keep(robot, meshes))

    def _bring(self, event: viser.GuiEvent[Any]) -> None:
        """Store the upload, and select it if it is a robot; runs on a thread of the server's pool."""
        upload = self._load.value
        self._choose(lambda: self._robots.brought(upload.name, upload.content))

    def _choose(self, keep: Callable[[], Path | None]) -> None:
        try:
            file = keep()
        except NerfnavError as error:
            self._post(Notify("Not applied", sentence(str(error)), bad=True))
            return
        if file is None:
            self._post(Notify("Mesh loaded", "Now load the robot file that names it."))
        elif self._session is not None:
            self._post(Choose(replace(self._session.choice, robot=str(file))))

    def _send(self, event: viser.GuiEvent[Any]) -> None:
        """Send the robot's file to the tab that requests it; runs on a thread of the server's pool."""
        robot = self._edited
        if event.client is not None and robot is not None:
            event.client.send_file_download(f"{robot.name}.yaml", to_yaml(robot), save_immediately=True)

    def show(self, session: Session) -> None:
        """Show the numbers of the selected robot with their edits."""
        self._session = session
        if session.choice.robot != self._chosen:
            self._chosen = session.choice.robot
            self._own = _described(self._chosen)
        robot = self._edited
        if robot is None:
            self._status.content = note("The file of this robot is missing: select another one.")
            return
        if robot is not self._checked:
            self._fill(robot)
            self._checked, self._problem = (
                robot,
                "" if self._own is None else explain_invalid_robot(robot, self._own[1]),
            )
        edited = session.robot_draft is not None
        self._status.content = (
            warning(self._problem)
            if self._problem
            else note("Edited: press Use this robot to apply." if edited else "No edits.")
        )
        self._use.disabled = not edited or bool(self._problem) or session.place is None
        self._discard.visible = edited

    def _fill(self, robot: RobotFile) -> None:
        """Copy the numbers into the widgets."""
        shape, body = name_shape(robot.body), robot.body
        shapes = _SHAPES if self._own is None else tuple(dict.fromkeys((*_SHAPES, name_shape(self._own[0].body))))
        if self._shape.options != shapes:
            self._shape.options = shapes
        self._name.value, self._kind.value, self._shape.value = robot.name, KINDS[robot.kind], shape
        self._box.visible, self._radius.visible = body.box is not None, body.cylinder is not None
        self._height.visible = body.cylinder is not None
        if body.box is not None:
            self._box.value = body.box
        if body.cylinder is not None:
            self._radius.value, self._height.value = body.cylinder.radius, body.cylinder.height
        for number, widget in self._numbers.items():
            value = number.of(robot)
            widget.visible = value is not None
            if value is not None:
                widget.value = value


def explain_invalid_robot(robot: RobotFile, folder: Path) -> str:
    """Explain in one sentence why a robot is impossible or cannot be planned for; empty for a valid one."""
    try:
        robot_of(robot, folder).require_planned()
    except NerfnavError as error:
        return sentence(str(error).replace(f"{folder}/", ""))
    return ""


def _described(robot: str) -> tuple[RobotFile, Path] | None:
    """Read a robot's file and the folder of its meshes; None where the file is missing."""
    try:
        return describe_robot(robot)
    except NerfnavError:
        return None
