"""Alignment panel: correct up, scale and box of a place by hand, without training again."""

from collections.abc import Callable
from pathlib import Path

import viser

from nerfnav.core.errors import NerfnavError
from nerfnav.geometry import Box
from nerfnav.importers import format_length
from nerfnav_app.page.kit.html import note, warning
from nerfnav_app.places.sources import title_of
from nerfnav_app.state.actions import Command, Tell
from nerfnav_app.state.alignment import (
    AlignmentDraft,
    ApplyAlignment,
    DiscardAlignment,
    FindFloor,
    Keep,
    PickPoints,
    PickTarget,
    SetDistance,
    UndoAlignment,
    Vector,
)
from nerfnav_app.state.session import Session
from nerfnav_app.text import sentence

_ICON = viser.Icon


class AlignmentPanel:
    """A folder with what was guessed, what to point at, a box, and what applies and undoes it."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """`post` takes what the user asks."""
        self._post = post
        self._session: Session | None = None
        with server.gui.add_folder("Up, scale, box", expand_by_default=False):
            self._guessed = server.gui.add_html(note("Opening…"))
            self._point = server.gui.add_button_group(
                "Click", tuple(kind.value for kind in PickTarget), hint="Two points to measure, or three of the floor"
            )
            self._distance = server.gui.add_number(
                "Distance [m]", 0.0, min=0.0, step=0.001, hint="How far the two points are apart in truth"
            )
            self._find = server.gui.add_checkbox(
                "Find the floor", False, hint="Take the level plane that most lies on for the floor"
            )
            self._crop = server.gui.add_checkbox("Crop", False, hint="Keep a part of the place alone")
            self._lower = server.gui.add_vector3("Keep from [m]", (0.0, 0.0, 0.0), step=0.01, visible=False)
            self._upper = server.gui.add_vector3("Keep to [m]", (0.0, 0.0, 0.0), step=0.01, visible=False)
            self._said = server.gui.add_html("")
            self._buttons = [
                self._button(server, "Apply", _ICON.CHECK, ApplyAlignment(), "Put the place right; nothing is learned"),
                self._button(
                    server, "As it was before", _ICON.ARROW_BACK_UP, UndoAlignment(), "Before the last change"
                ),
                self._button(server, "Forget", _ICON.ERASER, DiscardAlignment(), "Forget what was clicked and typed"),
            ]
            keep = server.gui.add_button("Save the field", color="gray", icon=_ICON.DOWNLOAD, hint="As a file (.npz)")
        self._point.on_click(self._point_at)
        self._distance.on_update(self._measure)
        self._find.on_update(self._find_floor)
        for widget in (self._crop, self._lower, self._upper):
            widget.on_update(self._keep)
        keep.on_click(self._send)

    def _button(
        self, server: viser.ViserServer, name: str, icon: viser.IconName, command: Command, hint: str
    ) -> viser.GuiButtonHandle:
        button = server.gui.add_button(name, color="gray", icon=icon, hint=hint)

        @button.on_click
        async def _(_: viser.GuiEvent) -> None:
            self._post(command)

        return button

    async def _point_at(self, event: viser.GuiEvent) -> None:
        if event.client is not None:
            self._post(PickPoints(PickTarget(event.target.value)))

    async def _measure(self, event: viser.GuiEvent) -> None:
        if event.client is not None:
            self._post(SetDistance(float(self._distance.value)))

    async def _find_floor(self, event: viser.GuiEvent) -> None:
        if event.client is not None:
            self._post(FindFloor(self._find.value))

    async def _keep(self, event: viser.GuiEvent) -> None:
        if event.client is None or self._session is None or self._session.place is None:
            return  # the session wrote it
        if not self._crop.value:
            self._post(Keep(None))
        elif self._session.placing.kept is None:
            box = self._session.place.field.box
            self._post(Keep((_corner(box.lower.tolist()), _corner(box.upper.tolist()))))
        else:
            self._post(Keep((_corner(self._lower.value), _corner(self._upper.value))))

    def _send(self, event: viser.GuiEvent) -> None:
        """Send the field's file to the tab that asked; runs on a thread of the server's pool."""
        place = self._session.place if self._session is not None else None
        if event.client is None or place is None:
            return
        if place.file is None:
            self._post(Tell("No file", "This place was made in memory.", bad=True))
            return
        try:
            content = Path(place.file).read_bytes()
        except OSError as error:
            self._post(Tell("Not saved", f"{title_of(str(place.file))} cannot be read: {error.strerror}", bad=True))
            return
        event.client.send_file_download(f"{place.name}.npz", content, save_immediately=True)

    def show(self, session: Session) -> None:
        """Show what is known, and put the session's numbers into the widgets."""
        self._session = session
        place, placing = session.place, session.placing
        if place is None:
            self._guessed.content, self._said.content = note("Opening…"), ""
            return
        self._guessed.content = note(known(place.field.info.guesses, place.field.box))
        self._said.content = described(placing)
        self._distance.value = placing.distance or 0.0
        self._find.value = placing.find_floor
        self._crop.value = placing.kept is not None
        self._lower.visible = self._upper.visible = placing.kept is not None
        if placing.kept is not None:
            self._lower.value, self._upper.value = placing.kept
        for button, wanted in zip(self._buttons, (session.may_begin, bool(placing.undo), True), strict=True):
            button.disabled = not wanted


def known(guesses: tuple[str, ...], box: Box) -> str:
    """What is known of up and lengths: sentences."""
    longest = f"This place is {format_length(float(box.size.max()))} long."
    if not guesses:
        return longest
    return " ".join([longest, "Guessed:", *map(sentence, guesses)])


def described(placing: AlignmentDraft) -> str:
    """What has been told so far, and what comes next, as HTML."""
    if placing.pointing is not None:
        points = placing.measured if placing.pointing is PickTarget.DISTANCE else placing.floor
        return note(f"Click point {len(points) + 1} of {placing.pointing.count} of {placing.pointing.value}.")
    told = []
    if placing.length is not None:
        told.append(f"The two points are {format_length(placing.length)} apart now: type what it is in truth.")
    if len(placing.floor) == 3:
        told.append("Three points of the floor: Apply puts it at z = 0.")
    try:
        placing.correction()
    except NerfnavError as error:
        return warning(sentence(str(error)))
    return note(" ".join(told or map(sentence, placing.told)))


def _corner(values: tuple[float, ...] | list[float]) -> Vector:
    x, y, z = (round(float(value), 4) for value in values)
    return x, y, z
