"""Alignment panel: correct up, scale and box of a place by hand, without training again."""

from collections.abc import Callable
from functools import partial
from pathlib import Path

import viser

from nerfnav.core.errors import NerfnavError
from nerfnav.geometry import Box
from nerfnav.importers import format_length
from nerfnav_app.page.kit.html import note, warning
from nerfnav_app.page.kit.widgets import post_on
from nerfnav_app.places.sources import title_of
from nerfnav_app.state.actions import Command, Notify
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
    """Panel of the alignment: measurements, a crop box, and buttons to apply and undo them."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """Add the widgets; `post` takes the commands."""
        self._post = post
        self._session: Session | None = None
        with server.gui.add_folder("Up, scale, box", expand_by_default=False):
            self._guessed = server.gui.add_html(note("Opening…"))
            self._point = server.gui.add_button_group(
                "Click",
                tuple(kind.value for kind in PickTarget),
                hint="Click two points to measure, or three of the floor",
            )
            self._distance = server.gui.add_number(
                "Distance [m]", 0.0, min=0.0, step=0.001, hint="True distance of the two points"
            )
            self._find = server.gui.add_checkbox(
                "Find the floor", False, hint="Detect the horizontal plane that holds most of the surface"
            )
            self._crop = server.gui.add_checkbox("Crop", False, hint="Keep a box of the place")
            self._lower = server.gui.add_vector3("Keep from [m]", (0.0, 0.0, 0.0), step=0.01, visible=False)
            self._upper = server.gui.add_vector3("Keep to [m]", (0.0, 0.0, 0.0), step=0.01, visible=False)
            self._status = server.gui.add_html("")
            button = partial(server.gui.add_button, color="gray")
            self._apply = button("Apply", icon=_ICON.CHECK, hint="Align the place without training again")
            self._undo = button("Undo alignment", icon=_ICON.ARROW_BACK_UP, hint="Restore the earlier place")
            self._discard = button("Discard input", icon=_ICON.ERASER, hint="Discard clicks and numbers")
            self._save = button("Save the field", icon=_ICON.DOWNLOAD, hint="As .npz")
        post_on(self._point.on_click, post, lambda: PickPoints(PickTarget(self._point.value)))
        post_on(self._distance.on_update, post, lambda: SetDistance(float(self._distance.value)))
        post_on(self._find.on_update, post, lambda: FindFloor(self._find.value))
        for widget in (self._crop, self._lower, self._upper):
            post_on(widget.on_update, post, self._keep)
        post_on(self._apply.on_click, post, ApplyAlignment)
        post_on(self._undo.on_click, post, UndoAlignment)
        post_on(self._discard.on_click, post, DiscardAlignment)
        self._save.on_click(self._send)

    def _keep(self) -> Keep | None:
        if self._session is None or self._session.place is None:
            return None
        if not self._crop.value:
            return Keep(None)
        if self._session.alignment.kept is None:
            box = self._session.place.field.box
            return Keep((_corner(box.lower.tolist()), _corner(box.upper.tolist())))
        return Keep((_corner(self._lower.value), _corner(self._upper.value)))

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
        self._guessed.content = note(describe_scale(place.field.info.guesses, place.field.box))
        self._status.content = describe(draft)
        self._distance.value = draft.distance or 0.0
        self._find.value = draft.find_floor
        self._crop.value = draft.kept is not None
        self._lower.visible = self._upper.visible = draft.kept is not None
        if draft.kept is not None:
            self._lower.value, self._upper.value = draft.kept
        self._apply.disabled, self._undo.disabled = not session.may_begin, not draft.undo


def describe_scale(guesses: tuple[str, ...], box: Box) -> str:
    """Describe the length of the place, and what was guessed of up and scale."""
    longest = f"This place is {format_length(float(box.size.max()))} long."
    return " ".join([longest, "Guessed:", *map(sentence, guesses)]) if guesses else longest


def describe(draft: AlignmentDraft) -> str:
    """Describe the measurements so far and the next action, as HTML."""
    if draft.pointing is not None:
        points = draft.measured if draft.pointing is PickTarget.DISTANCE else draft.floor
        return note(f"Click point {len(points) + 1} of {draft.pointing.count} ({draft.pointing.value}).")
    texts = []
    if draft.length is not None:
        texts.append(f"The two points are {format_length(draft.length)} apart now: type their true distance.")
    if len(draft.floor) == 3:
        texts.append("The floor is set by three points: Apply moves it to z = 0.")
    try:
        draft.request()
    except NerfnavError as error:
        return warning(sentence(str(error)))
    return note(" ".join(texts or map(sentence, draft.changes)))


def _corner(values: tuple[float, ...] | list[float]) -> Vector:
    x, y, z = (round(float(value), 4) for value in values)
    return x, y, z
