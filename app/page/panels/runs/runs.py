"""Panel of stored runs: flights that were flown here, to open, compare, rename and delete."""

from collections.abc import Callable
from functools import partial
from typing import Any

import viser

from nerfnav_app.page.kit.html import note
from nerfnav_app.page.panels.delete_dialog import ask_to_delete
from nerfnav_app.page.panels.run_words import comparison, describe
from nerfnav_app.state.actions import Command
from nerfnav_app.state.run_actions import CompareRun, DeleteRun, ListRuns, OpenRun, RenameRun
from nerfnav_app.state.session import Session
from nerfnav_app.storage.run_metadata import StoredRun

_NONE = "(no flights yet)"


class RunsPanel:
    """A list, what is known of the chosen flight, and what can be done with it."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """`post` takes what the user asks."""
        self._post = post
        self._session: Session | None = None
        self._renamed: dict[str, str] = {}
        self._list: viser.GuiDropdownHandle[str] = server.gui.add_dropdown(
            "Flight", [_NONE], hint="Every flight is kept, step by step as it is flown"
        )
        self._about = server.gui.add_html(note("Flights are kept here: fly one."))
        self._actions = server.gui.add_button_group("Show", ("Open", "Compare"), visible=False)
        self._name = server.gui.add_text("New name", "", visible=False)
        self._change = server.gui.add_button_group("Change", ("Rename", "Delete"), visible=False)
        self._comparison = server.gui.add_html("", visible=False)
        self._alone = server.gui.add_button("End comparison", color="gray", icon=viser.Icon.X, visible=False)
        self._list.on_update(self._choose)
        self._actions.on_click(self._act)
        self._change.on_click(self._alter)

        @self._alone.on_click
        async def _(_: viser.GuiEvent) -> None:
            post(CompareRun(None))

    @property
    def _chosen(self) -> StoredRun | None:
        """The flight that is chosen; a page can send any name."""
        return None if self._session is None else self._session.runs.entry(str(self._list.value))

    async def _choose(self, event: viser.GuiEvent[Any]) -> None:
        if event.client is not None and self._session is not None:
            self._post(ListRuns())
            self.show(self._session)

    async def _act(self, event: viser.GuiEvent[Any]) -> None:
        entry, word = self._chosen, event.target.value
        if entry is not None and word in ("Open", "Compare"):
            self._post(OpenRun(entry.name) if word == "Open" else CompareRun(entry.name))

    async def _alter(self, event: viser.GuiEvent[Any]) -> None:
        entry, word = self._chosen, event.target.value
        if entry is None or event.client is None:
            return
        if word == "Rename":
            name = str(self._name.value).strip()
            self._renamed[entry.name] = name
            self._post(RenameRun(entry.name, name))
        elif word == "Delete":
            warning = f"{entry.name} and its pictures are deleted for good."
            ask_to_delete(event.client, "this flight", warning, partial(self._post, DeleteRun(entry.name)))

    def show(self, session: Session) -> None:
        """Show the stored runs."""
        self._session = session
        runs = session.runs
        names = tuple(entry.name for entry in runs.entries) or (_NONE,)
        before = str(self._list.value)
        if self._list.options != names:
            self._list.options = names
            after = before if before in names else self._renamed.pop(before, before)
            self._list.value = after if after in names else names[0]
        entry = self._chosen
        self._about.content = describe(entry) if entry is not None else note("Flights are kept here: fly one.")
        busy = session.in_flight
        for handle in (self._actions, self._change, self._name):
            handle.visible = entry is not None and not busy
        self._compare(session)

    def _compare(self, session: Session) -> None:
        compared = session.runs.compared
        self._comparison.visible = self._alone.visible = compared is not None
        if compared is not None:
            first = session.runs.opened
            shown = first is not None and first.record is session.flight
            numbers = session.flight.summary if session.flight is not None else {}
            self._comparison.content = comparison(
                first.entry.name if first is not None and shown else "this flight",
                numbers,
                compared.entry.name,
                compared.entry.metadata.metrics,
            )
