"""The table of stored flights: which are listed, in which order, which is selected, and what goes into the file."""

import csv
import io
from dataclasses import replace

import viser

from nerfnav_app.page.kit.theme import BELIEF, HIT, STALE, START
from nerfnav_app.page.panels.runs.runs import RunsPanel
from nerfnav_app.page.panels.runs.runs_table import SORT, SORT_KEYS, Listing, color_of, runs_csv, runs_table
from nerfnav_app.state.session import Session
from nerfnav_app.storage.run_metadata import StoredRun
from tests.app.storage.stored_runs import about


def run(name: str, error: float | None = 0.05, steps: int = 10, **known: object) -> StoredRun:
    metrics = {} if error is None else {"final_position_error_m": error}
    return StoredRun(name, about(**{"outcome": "reached", "metrics": metrics} | known), steps)  # type: ignore[arg-type]


RUNS = (
    run("new", 0.04, 30, date="2026-01-03T00:00:00+00:00", task="b"),
    run("far", 1.5, 20, date="2026-01-02T00:00:00+00:00", place="pyramids", source="pyramids", outcome="collided"),
    run("old", None, 10, date="2026-01-01T00:00:00+00:00", task="a", outcome=None),
)


def names(listing: Listing) -> list[str]:
    return [entry.name for entry in listing.of(RUNS)]


def test_flights_are_sorted_by_each_column_and_unknown_values_come_last() -> None:
    assert names(Listing()) == ["new", "far", "old"]
    assert names(Listing(sort="steps")) == ["old", "far", "new"]
    assert names(Listing(sort="final error")) == ["new", "far", "old"]
    assert names(Listing(sort="final error", reverse=True)) == ["far", "new", "old"]
    assert names(Listing(sort="task")) == ["old", "new", "far"]
    assert Listing().sorted_by("date").reverse and not Listing(reverse=True).sorted_by("steps").reverse


def test_flights_are_filtered_by_outcome_and_place() -> None:
    assert names(Listing(outcome="collided")) == ["far"]
    assert names(Listing(outcome="interrupted")) == ["old"]
    assert names(Listing(place="balls")) == ["new", "old"]
    assert names(Listing(outcome="reached", place="pyramids")) == []


def test_an_outcome_is_green_only_where_the_robot_is_at_the_goal() -> None:
    assert color_of(RUNS[0]) == START
    assert color_of(run("apart", 0.45)) == BELIEF
    assert color_of(RUNS[1]) == color_of(run("left", 3.0, outcome="outside")) == HIT
    assert color_of(RUNS[2]) == BELIEF
    assert color_of(replace(RUNS[2], flying=True)) == STALE


def test_the_table_shows_each_fact_and_marks_the_selected_flight() -> None:
    html = runs_table(RUNS, "far", Listing(), "w")
    for text in ("2026-01-02 00:00", "pyramids", "quadrotor", "custom", "collided", "20", "150 cm", "Date ↓"):
        assert text in html
    assert html.count('class="picked"') == 1
    assert all(f'data-value="{SORT}{key}"' in html for key in SORT_KEYS)


def test_the_file_has_a_row_for_each_listed_flight() -> None:
    rows = list(csv.DictReader(io.StringIO(runs_csv(RUNS))))
    assert [row["name"] for row in rows] == ["new", "far", "old"]
    assert rows[1]["final_error_m"] == "1.5" and rows[2]["final_error_m"] == "" and rows[0]["task"] == "b"


def listing(session: Session, *entries: StoredRun) -> Session:
    return replace(session, runs=replace(session.runs, entries=entries))


def test_the_newest_flight_is_selected_when_it_comes_and_the_users_choice_stays_until_then(
    server: viser.ViserServer, opened: Session
) -> None:
    panel = RunsPanel(server, lambda command: None)
    panel.show(listing(opened, *RUNS[1:]))
    assert panel._list.value == "far"
    panel._list.value = "old"
    panel.show(listing(opened, *RUNS[1:]))
    assert panel._list.value == "old"
    panel.show(listing(opened, *RUNS))
    assert panel._list.value == "new"
    panel.show(listing(opened, *RUNS[1:]))
    assert panel._list.value == "far", "the newest of those that are left"


def test_clicks_into_the_table_sort_and_select_and_anything_else_is_ignored(
    server: viser.ViserServer, opened: Session
) -> None:
    panel = RunsPanel(server, lambda command: None)
    panel.show(listing(opened, *RUNS))
    panel._pick("old")
    assert panel._list.value == "old"
    for order in (("old", "far", "new"), ("new", "far", "old")):
        panel._pick(SORT + "steps")
        assert panel._list.options == order and panel._list.value == "old"
    panel._pick("nonsense")
    panel._pick(SORT + "nonsense")
    assert panel._list.value == "old" and panel._sort.value == "steps"


def test_flights_of_the_open_place_are_offered_where_another_one_is_selected(
    server: viser.ViserServer, opened: Session
) -> None:
    panel = RunsPanel(server, lambda command: None)
    panel.show(listing(opened, *RUNS))
    assert not panel._same.visible
    panel._pick("far")
    assert panel._same.visible
