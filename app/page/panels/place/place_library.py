"""Place library panel: pictures and facts of places from uploads; open, rename and delete them."""

from collections.abc import Callable
from functools import partial
from typing import Any

import cv2
import numpy as np
import viser

from nerfnav.core.errors import NerfnavError
from nerfnav_app.page.kit.html import note, table
from nerfnav_app.page.kit.widgets import confirm_deletion
from nerfnav_app.places.library import KeptPlace, PlaceLibrary
from nerfnav_app.queries.place_list import PlaceListQuery
from nerfnav_app.state.actions import Command, ListPlaces, Notify, OpenPlace
from nerfnav_app.state.session import Session
from nerfnav_app.text import number, sentence

_NONE = "(none yet)"
_BLANK = np.full((2, 2, 3), 24, np.uint8)


class PlaceLibraryPanel:
    """Panel of the place library: a list, the selected place with its picture, and buttons for it."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None], library: PlaceLibrary) -> None:
        """Add the widgets; `post` takes the commands, `library` stores the places."""
        self._post, self._library = post, library
        self._session: Session | None = None
        self._entries: dict[str, KeptPlace] = {}
        self._pictured: KeptPlace | None = None
        self._opened = ""
        self._sought = False
        gui = server.gui
        with gui.add_folder("Place library", expand_by_default=False):
            self._list: viser.GuiDropdownHandle[str] = gui.add_dropdown(
                "Stored place", [_NONE], hint="Files that were opened here, with their trained fields"
            )
            self._picture = gui.add_image(_BLANK, visible=False)
            self._about = gui.add_html("")
            self._name = gui.add_text("Place name", "", visible=False)
            labels = ("Open place", "Rename place", "Download field", "Delete place")
            self._buttons = {label: self._button(server, label) for label in labels}
        self._list.on_update(self._choose)

    def _button(self, server: viser.ViserServer, label: str) -> viser.GuiButtonHandle:
        button = server.gui.add_button(label, color="gray", visible=False)

        @button.on_click
        def _(event: viser.GuiEvent[Any]) -> None:  # on a thread of the server's pool, for it touches the disk
            entry = self._chosen
            if entry is not None and event.client is not None:
                self._act(label, entry, event.client)

        return button

    @property
    def _chosen(self) -> KeptPlace | None:
        return self._entries.get(str(self._list.value))

    async def _choose(self, event: viser.GuiEvent[Any]) -> None:
        if event.client is not None:
            self._sought = False
            self._describe()

    def _act(self, label: str, entry: KeptPlace, client: viser.ClientHandle) -> None:
        if label == "Open place":
            self._post(OpenPlace(entry.what))
        elif label == "Rename place":
            name = str(self._name.value).strip()
            self._do("Not renamed", lambda: self._library.rename(entry.key, name))
        elif label == "Delete place":
            self._ask_to_delete(entry, client)
        else:
            try:
                client.send_file_download(f"{entry.name}.npz", entry.field_file.read_bytes(), save_immediately=True)
            except OSError as error:
                self._post(Notify("Not downloaded", f"{entry.name} cannot be read: {error.strerror}.", bad=True))

    def _do(self, title: str, change: Callable[[], None]) -> None:
        """Change the library and list it again."""
        try:
            change()
        except NerfnavError as error:
            self._post(Notify(title, sentence(str(error)), bad=True))
        self._post(ListPlaces())

    def _ask_to_delete(self, entry: KeptPlace, client: viser.ClientHandle) -> None:
        if self._session is not None and self._session.what == entry.what:
            self._post(Notify("Not deleted", f"{entry.name} is open: open another place first.", bad=True))
            return
        warning = f"{entry.name} and its field are deleted for good; flights in it stay."
        delete = partial(self._library.delete, entry.key)
        confirm_deletion(client, "this place", warning, lambda: self._do("Not deleted", delete))

    def show(self, session: Session) -> None:
        """Show the stored places."""
        self._session = session
        listed = PlaceListQuery.result_in(session)
        if listed is not None and tuple(self._entries.values()) != listed:
            before = self._chosen
            self._entries = {entry.name: entry for entry in listed}
            names = tuple(self._entries) or (_NONE,)
            self._list.options = names
            # the selected place stays selected under its new name
            kept = (entry.name for entry in listed if before is not None and entry.key == before.key)
            self._list.value = next(kept, names[0])
        self._select_opened(session.what)
        self._describe()

    def _select_opened(self, what: str) -> None:
        """Select the place that has been opened, once it is listed, until the user selects another one."""
        if what != self._opened:
            self._opened, self._sought = what, True
        here = next((entry.name for entry in self._entries.values() if entry.what == what), None)
        if self._sought and here is not None:
            self._list.value, self._sought = here, False

    def _describe(self) -> None:
        entry = self._chosen
        for widget in (self._name, *self._buttons.values()):
            widget.visible = entry is not None
        self._about.content = (
            note("Places that you open are stored here, with their trained fields.")
            if entry is None
            else (facts(entry))
        )
        if entry == self._pictured:
            return
        self._pictured = entry
        picture = None if entry is None else cv2.imread(str(entry.picture_file))
        self._picture.visible = picture is not None
        if entry is not None and picture is not None:
            self._picture.label = entry.name  # it need not be the open place
            self._picture.image = np.ascontiguousarray(picture[..., ::-1])


def facts(entry: KeptPlace) -> str:
    """Format the facts of a place as HTML."""
    date = entry.date[:16].replace("T", " ")
    size = number(entry.size_bytes / (1 << 20), "MB")
    return table([("Source", entry.source), ("First opened (UTC)", date), ("On disk", size)])
