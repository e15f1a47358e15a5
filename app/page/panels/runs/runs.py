"""Runs panel: open, compare, rename and delete stored flights."""

from collections.abc import Callable
from functools import partial
from typing import Any

import viser

from nerfnav_app.page.kit.html import LegendEntry, code, columns, legend, note, table
from nerfnav_app.page.kit.theme import OTHER_PLAN, OTHER_TRUTH
from nerfnav_app.page.kit.widgets import confirm_deletion, format_name, post_on
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
        ("Task", about.task or "custom start and goal"),
        ("Robot", format_name(about.robot)),
        ("Planner, estimator", f"{about.planner}, {'none (open loop)' if about.open_loop else about.estimator}"),
        ("Seed", str(about.seed)),
        ("Take-off (UTC)", about.date[:19].replace("T", " ")),
        ("Outcome", entry.outcome),
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
        ("Mean NEES (12 is consistent)", estimation.get("nees_mean"), 1, ""),
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


class RunsPanel:
    """Panel of the stored flights: a list, the selected flight, and buttons for it."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """Add the widgets; `post` takes the commands."""
        self._post = post
        self._session: Session | None = None
        self._renamed: dict[str, str] = {}
        self._list: viser.GuiDropdownHandle[str] = server.gui.add_dropdown(
            "Flight", [_NONE], hint="Every flight is stored, step by step"
        )
        self._about = server.gui.add_html(note("No flights yet. Press Fly: each flight is stored here."))
        self._actions = server.gui.add_button_group("Show", ("Open", "Compare"), visible=False)
        self._name = server.gui.add_text("New name", "", visible=False)
        self._change = server.gui.add_button_group("Change", ("Rename", "Delete"), visible=False)
        self._comparison = server.gui.add_html("", visible=False)
        self._alone = server.gui.add_button("End comparison", color="gray", icon=viser.Icon.X, visible=False)
        self._list.on_update(self._choose)
        post_on(self._actions.on_click, post, self._action)
        self._change.on_click(self._change_run)
        post_on(self._alone.on_click, post, lambda: CompareRun(None))

    @property
    def _chosen(self) -> StoredRun | None:
        """The selected flight; a page can send any name."""
        return None if self._session is None else self._session.runs.entry(str(self._list.value))

    async def _choose(self, event: viser.GuiEvent[Any]) -> None:
        if event.client is not None and self._session is not None:
            self._post(ListRuns())
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
        self._about.content = (
            describe(entry) if entry is not None else note("No flights yet. Press Fly: each flight is stored here.")
        )
        for handle in (self._actions, self._change, self._name):
            handle.visible = entry is not None and not session.in_flight
        self._compare(session)

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
