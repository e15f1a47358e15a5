"""Alignment panel: turn, scale and crop a place by hand, without training again."""

from collections.abc import Callable
from pathlib import Path

import viser

from nerfnav.geometry import Box
from nerfnav.importers import format_length
from nerfnav_app.page.kit.html import ROW, note
from nerfnav_app.page.kit.widgets import post_on
from nerfnav_app.places.sources import title_of
from nerfnav_app.state.actions import Command, Notify
from nerfnav_app.state.alignment import (
    AlignmentAction,
    AlignmentDraft,
    ApplyAlignment,
    Axis,
    Correction,
    Crop,
    DiscardAlignment,
    FindFloor,
    PickPoints,
    PickTarget,
    QuarterTurn,
    SetDistance,
    SetScale,
    ShowGizmo,
    UndoAlignment,
    Vector,
)
from nerfnav_app.state.session import Session
from nerfnav_app.text import sentence

_ICON = viser.Icon
_LEVELS: dict[str, AlignmentAction] = {"three points": PickPoints(PickTarget.FLOOR), "find it": FindFloor()}


class AlignmentPanel:
    """Panel of the alignment: turn, measure, crop, and buttons to apply and undo."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """Add the widgets; `post` takes the commands."""
        self._post = post
        self._session: Session | None = None
        gui = server.gui
        with gui.add_folder("Turn, scale, crop", expand_by_default=False):
            self._guessed = gui.add_html(note("Opening…"))
            self._gizmo = gui.add_checkbox("Turn by hand", False, hint="Drag the rings and arrows of the place")
            axes = tuple(axis.value for axis in Axis)
            self._quarter = gui.add_button_group("Turn by 90°", axes, hint="About an axis through the middle")
            self._level = gui.add_button_group(
                "Level", tuple(_LEVELS), hint="Click three points of the floor, or let the floor be found"
            )
            self._measure = gui.add_button("Click two points", color="gray", icon=_ICON.RULER, hint="To measure")
            self._distance = gui.add_number(
                "Distance [m]", 0.0, min=0.0, step=0.001, visible=False, hint="True distance of the two points"
            )
            self._scale = gui.add_number("Scale", 1.0, min=0.0, step=0.0001, hint="New metres in a metre of before")
            self._crop = gui.add_checkbox("Crop", False, hint="Keep a box of the place: drag its six faces")
            self._lower = gui.add_vector3("Keep from [m]", (0.0, 0.0, 0.0), step=0.01, visible=False)
            self._upper = gui.add_vector3("Keep to [m]", (0.0, 0.0, 0.0), step=0.01, visible=False)
            self._status = gui.add_html("")
            gui.add_html(ROW)
            self._apply = gui.add_button("Apply", hint="Correct the place without training again")
            self._undo = gui.add_button("Back", color="gray", hint="Undo the last step, or what was applied")
            self._discard = gui.add_button("Cancel", color="gray", hint="Leave the place as it was")
            self._save = gui.add_button("Save the field", color="gray", icon=_ICON.DOWNLOAD, hint="As .npz")
        post_on(self._gizmo.on_update, post, lambda: ShowGizmo(self._gizmo.value))
        post_on(self._quarter.on_click, post, lambda: QuarterTurn(Axis(self._quarter.value)))
        post_on(self._level.on_click, post, lambda: _LEVELS[self._level.value])
        post_on(self._measure.on_click, post, lambda: PickPoints(PickTarget.DISTANCE))
        post_on(self._distance.on_update, post, lambda: SetDistance(float(self._distance.value)))
        post_on(self._scale.on_update, post, lambda: SetScale(float(self._scale.value)))
        post_on(self._crop.on_update, post, self._box)
        for corner in (self._lower, self._upper):
            post_on(corner.on_update, post, lambda: Crop((_corner(self._lower.value), _corner(self._upper.value))))
        post_on(self._apply.on_click, post, ApplyAlignment)
        post_on(self._undo.on_click, post, UndoAlignment)
        post_on(self._discard.on_click, post, DiscardAlignment)
        self._save.on_click(self._send)

    def _box(self) -> Crop | None:
        """Keep all of the place at first: its faces are to be dragged from there."""
        if self._session is None or self._session.place is None:
            return None
        if not self._crop.value:
            return Crop(None)
        box = self._session.alignment.now.box(self._session.place.field.box)
        return Crop((_corner(box.lower.tolist()), _corner(box.upper.tolist())))

    def _send(self, event: viser.GuiEvent) -> None:
        """Send the field's file to the tab that requests it; runs on a thread of the server's pool."""
        place = self._session.place if self._session is not None else None
        if event.client is None or place is None:
            return
        if place.file is None:
            self._post(Notify("No file", "This place exists in memory only.", bad=True))
            return
        try:
            content = Path(place.file).read_bytes()
        except OSError as error:
            self._post(Notify("Not saved", f"{title_of(str(place.file))} cannot be read: {error.strerror}", bad=True))
        else:
            event.client.send_file_download(f"{place.name}.npz", content, save_immediately=True)

    def show(self, session: Session) -> None:
        """Show what is known, and copy the session's numbers into the widgets."""
        self._session = session
        place, draft = session.place, session.alignment
        if place is None:
            self._guessed.content, self._status.content = note("Opening…"), ""
            return
        box, now = draft.now.box(place.field.box), draft.now
        self._guessed.content = note(describe_scale(place.field.info.guesses, box))
        self._status.content = describe(draft)
        self._gizmo.value = draft.by_hand
        self._distance.visible = draft.length is not None
        self._distance.value = round(draft.length or 0.0, 4)
        self._scale.value = now.similarity.scale
        self._crop.value = now.crop is not None
        self._lower.visible = self._upper.visible = now.crop is not None
        if now.crop is not None:
            self._lower.value, self._upper.value = map(_corner, now.crop)
        self._apply.disabled = not session.may_begin or now.request().is_empty
        self._undo.disabled, self._discard.disabled = not (draft.past or draft.undo), not draft.is_shown


def describe_scale(guesses: tuple[str, ...], box: Box) -> str:
    """Describe the length of the place, and what was guessed of up and scale."""
    longest = f"This place is {format_length(float(box.size.max()))} long."
    return " ".join([longest, "Guessed:", *map(sentence, guesses)]) if guesses else longest


def describe(draft: AlignmentDraft) -> str:
    """Describe the measurements so far and the next action, as HTML."""
    if draft.pointing is not None:
        return note(f"Click point {len(draft.picked) + 1} of {draft.pointing.count} ({draft.pointing.value}).")
    if draft.finding:
        return note("Finding the floor…")
    if draft.length is not None:
        return note(f"The two points are {format_length(draft.length)} apart: type their true distance.")
    if draft.now != Correction():
        return note("Apply makes the field anew as it is shown; Cancel leaves it as it was.")
    return note(" ".join(map(sentence, draft.changes)))


def _corner(values: tuple[float, ...] | list[float]) -> Vector:
    x, y, z = (round(float(value), 4) for value in values)
    return x, y, z
