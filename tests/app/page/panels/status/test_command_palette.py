"""Commands of the palette: each is there, by the name that it has elsewhere, and possible where its button is."""

import re
from dataclasses import replace
from importlib.resources import files

import nerfnav_scenes as scenes
from nerfnav.planner import PLANNERS
from nerfnav_app.page.panels.runs.runs import describe
from nerfnav_app.page.panels.status.command_palette import InBrowser, entries
from nerfnav_app.state.actions import Adjust, StartComparison
from nerfnav_app.state.flight import FlightRecord
from nerfnav_app.state.obstacles import ChooseMode, GizmoMode, ObstacleKind, new_obstacle
from nerfnav_app.state.runs import CompareRun
from nerfnav_app.state.session import Session
from nerfnav_app.storage.run_metadata import StoredRun
from tests.app.doubles import flight_step
from tests.app.sessions import after
from tests.app.storage.stored_runs import ENDS, about

ENTRIES = {entry.label: entry for entry in entries()}


def test_only_places_that_can_be_opened_are_offered_and_no_label_is_there_twice() -> None:
    places = {label.removeprefix("Open ") for label in ENTRIES if label.startswith("Open ")} - {"a file"}
    assert places == set(scenes.with_fields()) and "blocks" not in places
    assert len(ENTRIES) == len(entries())


def test_commands_that_browsers_follow_are_those_of_the_script() -> None:
    script = (files("nerfnav_app.page") / "picks.js").read_text()
    (table,) = re.findall(r"TABS = \{(.*?)\}", script)
    labels = re.findall(r'"([^"]+)": "', table)
    opened = [label for label, entry in ENTRIES.items() if isinstance(entry.asks(Session.opening("balls")), InBrowser)]
    assert set(opened) <= set(labels) <= set(ENTRIES)


def test_planners_are_compared_and_the_line_coloured_and_no_longer(opened: Session) -> None:
    assert ENTRIES["Compare planners"].asks(opened) == StartComparison()
    color = ENTRIES["Line by clearance"].asks(opened)
    assert isinstance(color, Adjust) and color.value is True
    assert after(opened, color).view_settings.clearance
    back = ENTRIES["Line by clearance"].asks(after(opened, color))
    assert isinstance(back, Adjust) and back.value is False


def test_the_flight_that_has_just_ended_is_compared_with_the_one_before_in_its_place(opened: Session) -> None:
    assert ENTRIES["Compare flights"].asks(opened) is None
    runs = tuple(
        StoredRun(name, about(place=place, source=place), 3)
        for name, place in (("this", "balls"), ("far", "pyramids"), ("before", "balls"))
    )
    flown = FlightRecord(ENDS).with_step(flight_step(ENDS, 0))
    session = replace(opened, flight=flown, runs=replace(opened.runs, entries=runs))
    assert ENTRIES["Compare flights"].asks(session) == CompareRun("before")


def test_keys_turn_the_handles_of_a_chosen_obstacle_and_else_the_camera(opened: Session) -> None:
    placed = new_obstacle(ObstacleKind.BOX, "box 1", 0.2, (0.0, 0.0, 0.5))
    chosen = replace(opened, obstacles=(placed,), chosen=placed.name)

    def commands_by_key(session: Session) -> dict[tuple[str, str | None], list[str]]:
        keys: dict[tuple[str, str | None], list[str]] = {}
        for label, entry in ENTRIES.items():
            if entry.key is not None and entry.has_key(session):
                keys.setdefault((entry.key, entry.modifier), []).append(label)
        return keys

    for session, subject in ((opened, "Camera: "), (chosen, "Obstacle: ")):
        keys = commands_by_key(session)
        assert all(len(labels) == 1 for labels in keys.values())
        assert all(keys[str(number), None][0].startswith(subject) for number in (1, 2, 3))
        assert keys["4", None] == ["Camera: from above"]
    assert ENTRIES["Obstacle: turn"].asks(opened) is None
    turn = ENTRIES["Obstacle: turn"].asks(chosen)
    assert turn == ChooseMode(GizmoMode.TURN)
    assert ENTRIES["Obstacle: turn"].asks(after(chosen, turn)) is None


def test_a_reset_asks_first() -> None:
    assert [label for label, entry in ENTRIES.items() if entry.confirm is not None] == ["Reset"]


def test_a_planner_has_one_name_in_palette_menu_and_runs() -> None:
    palette = [label.removeprefix("Planner: ") for label in ENTRIES if label.startswith("Planner: ")]
    assert palette == list(PLANNERS)
    for name in PLANNERS:
        assert f">{name}, paper<" in describe(StoredRun("one", about(planner=name), 3))
