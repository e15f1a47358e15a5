"""Runs panel: a table of the stored flights; open, compare, rename, delete and download them."""

from collections.abc import Callable
from functools import partial
from typing import Any

import viser

from nerfnav_app.page.kit.data_table import Picks
from nerfnav_app.page.kit.html import LegendEntry, code, columns, legend, note, table
from nerfnav_app.page.kit.theme import OTHER_PLAN, OTHER_TRUTH
from nerfnav_app.page.kit.widgets import confirm_deletion, format_name, post_on
from nerfnav_app.page.panels.runs.runs_table import (
    ANY,
    CUSTOM,
    SORT,
    SORT_KEYS,
    Listing,
    format_outcome,
    runs_csv,
    runs_table,
)
from nerfnav_app.state.actions import Command
from nerfnav_app.state.runs import CompareRun, DeleteRun, ListRuns, OpenRun, RenameRun
from nerfnav_app.state.session import Session
from nerfnav_app.storage.run_metadata import RunMetadata, StoredRun
from nerfnav_app.text import number


def describe(entry: StoredRun) -> str:
    """Format the facts of a flight as HTML."""
    about = entry.metadata
    rows = [
        ("Place", about.place),
        ("Task", about.task or CUSTOM),
        ("Robot", format_name(about.robot)),
        ("Planner, estimator", f"{about.planner}, {'none (open loop)' if about.open_loop else about.estimator}"),
        ("Seed", str(about.seed)),
        ("Take-off (UTC)", about.date[:19].replace("T", " ")),
        ("Outcome", format_outcome(entry.outcome)),
        ("Time steps", f"{entry.steps}, each {about.dt:g} s"),
    ]
    return table([*rows, *list_numbers(about.metrics)]) + describe_command(about)


def describe_command(about: RunMetadata) -> str:
    """Format the command that flies a flight again as HTML; empty where it is not known."""
    if about.command is None:
        return ""
    left_out = f", without what was asked for on the way: {', '.join(about.requests)}" if about.requests else ""
    return note(f"This command flies it again{left_out}.") + code(about.command)


def list_numbers(metrics: dict[str, Any]) -> list[tuple[str, str]]:
    """Select the metrics of a flight for comparison, with units; unknown ones are left out."""
    estimation, timing = metrics.get("estimation") or {}, metrics.get("timing_ms") or {}
    known = (
        ("Distance from the goal", metrics.get("final_position_error_m"), 100, "cm"),
        ("Steps in collision", metrics.get("mesh_collision_steps"), 1, ""),
        ("Position RMSE", estimation.get("position_rmse_m"), 100, "cm"),
        ("Attitude RMSE", estimation.get("rotation_rmse_rad"), 57.2958, "°"),
        ("Mean NEES (12 expected)", estimation.get("nees_mean"), 1, ""),
        ("Filter, median", timing.get("filter_p50"), 1, "ms"),
        ("Replanning, median", timing.get("replan_p50"), 1, "ms"),
    )
    return [(name, number(scale * value, unit)) for name, value, scale, unit in known if value is not None]


def comparison(first: str, metrics: dict[str, Any], second: str, others: dict[str, Any]) -> str:
    """Format the numbers of two flights side by side as HTML."""
    left, right = dict(list_numbers(metrics)), dict(list_numbers(others))
    names = [name for name, _ in list_numbers(metrics | others)]
    rows = [(name, left.get(name, "–"), right.get(name, "–")) for name in names]
    entries = (LegendEntry(OTHER_TRUTH, "path of the second"), LegendEntry(OTHER_PLAN, "plan of the second"))
    titles = note(f"First: {first}. Second: {second}.")
    return titles + legend(entries) + columns(("", "first", "second"), rows)


_NONE = "(no flights yet)"
_NOTHING = "No flights yet. Press Fly: each flight is stored here."
_NO_MATCH = "No flight matches: choose another outcome or place."


class RunsPanel:
    """Panel of the stored flights: a table, the selected flight, and buttons for it."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """Add the widgets; `post` takes the commands."""
        self._post = post
        self._session: Session | None = None
        self._renamed: dict[str, str] = {}
        self._newest = ""
        self._reverse = False
        gui = server.gui
        self._outcome: viser.GuiDropdownHandle[str] = gui.add_dropdown("Outcome", [ANY], hint="List only these")
        self._place: viser.GuiDropdownHandle[str] = gui.add_dropdown("In place", [ANY], hint="List only flights there")
        self._sort: viser.GuiDropdownHandle[str] = gui.add_dropdown(
            "Sort by", list(SORT_KEYS), hint="A second click on the head of a column reverses the order"
        )
        self._table = gui.add_html("", visible=False)
        self._picks = Picks(server, self._pick)
        self._list: viser.GuiDropdownHandle[str] = gui.add_dropdown(
            "Flight", [_NONE], hint="Every flight is stored, step by step"
        )
        self._about = gui.add_html(note(_NOTHING))
        self._actions = gui.add_button_group("Show", ("Open", "Compare"), visible=False)
        self._same = gui.add_button("List flights of this place", color="gray", icon=viser.Icon.FILTER, visible=False)
        self._name = gui.add_text("New name", "", visible=False)
        self._change = gui.add_button_group("Change", ("Rename", "Delete"), visible=False)
        self._comparison = gui.add_html("", visible=False)
        self._alone = gui.add_button("End comparison", color="gray", icon=viser.Icon.X, visible=False)
        self._csv = gui.add_button(
            "Download table", color="gray", icon=viser.Icon.TABLE, visible=False, hint="The listed flights as CSV"
        )
        for widget in (self._outcome, self._place, self._list):
            widget.on_update(self._choose)
        self._sort.on_update(self._choose_order)
        post_on(self._actions.on_click, post, self._action)
        self._same.on_click(self._list_same_place)
        self._change.on_click(self._change_run)
        post_on(self._alone.on_click, post, lambda: CompareRun(None))
        self._csv.on_click(self._send_csv)

    @property
    def _chosen(self) -> StoredRun | None:
        """The selected flight; a page can send any name."""
        return None if self._session is None else self._session.runs.entry(str(self._list.value))

    @property
    def _listing(self) -> Listing:
        return Listing(str(self._outcome.value), str(self._place.value), str(self._sort.value), self._reverse)

    async def _choose(self, event: viser.GuiEvent[Any]) -> None:
        if event.client is not None and self._session is not None:
            self._post(ListRuns())
            self.show(self._session)

    async def _choose_order(self, event: viser.GuiEvent[Any]) -> None:
        if event.client is not None:
            self._reverse = False
            await self._choose(event)

    async def _list_same_place(self, event: viser.GuiEvent[Any]) -> None:
        if event.client is not None and self._session is not None and self._session.place is not None:
            self._place.value = self._session.place.name
            self.show(self._session)

    def _pick(self, value: str) -> None:
        """Sort or select by a click into the table."""
        if self._session is None:
            return
        if value.removeprefix(SORT) in SORT_KEYS and value.startswith(SORT):
            listing = self._listing.sorted_by(value.removeprefix(SORT))
            self._sort.value, self._reverse = listing.sort, listing.reverse
        elif value in self._list.options:
            self._list.value = value
        self.show(self._session)

    def _action(self) -> OpenRun | CompareRun | None:
        kind = {"Open": OpenRun, "Compare": CompareRun}.get(self._actions.value)
        return None if self._chosen is None or kind is None else kind(self._chosen.name)

    async def _change_run(self, event: viser.GuiEvent[Any]) -> None:
        entry, word = self._chosen, event.target.value
        if entry is None or event.client is None:
            return
        if word == "Rename":
            name = str(self._name.value).strip()
            self._renamed[entry.name] = name
            self._post(RenameRun(entry.name, name))
        elif word == "Delete":
            warning = f"{entry.name} and its pictures are deleted for good."
            confirm_deletion(event.client, "this flight", warning, partial(self._post, DeleteRun(entry.name)))

    def _send_csv(self, event: viser.GuiEvent[Any]) -> None:
        """Send the listed flights to the tab that requests them; runs on a thread of the server's pool."""
        if event.client is not None and self._session is not None:
            listed = self._listing.of(self._session.runs.entries)
            event.client.send_file_download("flights.csv", runs_csv(listed).encode(), save_immediately=True)

    def show(self, session: Session) -> None:
        """Show the stored runs."""
        self._session = session
        entries = session.runs.entries
        _offer(self._outcome, sorted({entry.outcome for entry in entries}))
        _offer(self._place, sorted({entry.metadata.place for entry in entries}))
        listing = self._listing
        listed = listing.of(entries)
        self._select(session, tuple(entry.name for entry in listed))
        entry = self._chosen
        text = note(_NO_MATCH if entries else _NOTHING)
        self._about.content = describe(entry) if entry is not None else text
        self._table.visible = self._csv.visible = bool(listed)
        if listed:
            self._table.content = runs_table(listed, str(self._list.value), listing, self._picks.id)
        for handle in (self._actions, self._change, self._name):
            handle.visible = entry is not None and not session.in_flight
        # flights of different places are not compared: offer those of the open one
        self._same.visible = entry is not None and session.place is not None and not session.is_place_of(entry)
        self._compare(session)

    def _select(self, session: Session, names: tuple[str, ...]) -> None:
        """Offer these flights; a flight that has just been added is selected, else the selected one stays."""
        newest = session.runs.entries[0].name if session.runs.entries else ""
        before, added = str(self._list.value), newest != self._newest and newest not in self._list.options
        self._newest = newest
        if self._list.options == (names or (_NONE,)):
            return
        self._list.options = names or (_NONE,)
        after = before if before in names else self._renamed.pop(before, before)
        if added and newest in names:
            after = newest
        self._list.value = after if after in names else (names or (_NONE,))[0]

    def _compare(self, session: Session) -> None:
        compared = session.runs.compared
        self._comparison.visible = self._alone.visible = compared is not None
        if compared is not None:
            first = session.runs.opened
            self._comparison.content = comparison(
                first.entry.name if first is not None and first.record is session.flight else "this flight",
                session.flight.summary if session.flight is not None else {},
                compared.entry.name,
                compared.entry.metadata.metrics,
            )


def _offer(widget: viser.GuiDropdownHandle[str], values: list[str]) -> None:
    """Set the options of a filter; a value that is gone lets everything through."""
    options = (ANY, *values)
    if widget.options != options:
        before = widget.value
        widget.options = options
        widget.value = before if before in options else ANY
