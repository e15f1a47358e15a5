"""Settings that only the page can set have no validation of their own: the bounds of their widgets stop nonsense."""

from pathlib import Path
from typing import Any

import pytest

from nerfnav_app.page.panels.flight.estimate import EstimatePanel
from nerfnav_app.page.panels.flight.flight import FlightSettingsWidgets
from nerfnav_app.page.panels.place.place import PlacePanel
from nerfnav_app.page.panels.place.view_settings import ViewSettingsPanel
from nerfnav_app.page.panels.plan.ends import EndsPanel
from nerfnav_app.page.panels.runs.export import ExportPanel
from nerfnav_app.page.panels.status.timeline import TimelinePanel
from nerfnav_app.security.widget_values import may_set
from nerfnav_app.state.actions import Command
from nerfnav_app.state.session import Session
from tests.app.security.hostile import INF, NAN, Page


class NoRobots:
    """Nor any robot."""

    def files(self) -> tuple[Path, ...]:
        return ()


class NoUploads:
    """Nothing is brought here."""

    robots = NoRobots()


@pytest.fixture
def widgets(served: Page, opened: Session) -> dict[str, Any]:
    """All widgets of the panels by label, as the page shows them for an open place."""
    posted: list[Command] = []
    panels = (EndsPanel, EstimatePanel, ExportPanel, FlightSettingsWidgets, ViewSettingsPanel, TimelinePanel)
    for panel in panels:
        panel(served.server, posted.append).show(opened)
    PlacePanel(served.server, posted.append, NoUploads()).show(opened)  # type: ignore[arg-type]
    return {str(widget.label): widget for widget in served.server.gui._gui_input_handle_from_uuid.values()}


@pytest.mark.parametrize(
    ("label", "bad"),
    [
        ("Seed", -1),
        ("Seed", -1.0),
        ("Seed", 2**32),
        ("Push [cm]", NAN),
        ("Push [cm]", 11.0),
        ("Twist [°]", INF),
        ("Twist [°]", 12.0),
        ("Speed", "as fast as light"),
        ("Field", "the truth"),
        ("Opacity [%]", -10.0),
        ("Cut above [%]", 101.0),
        ("Slice at [%]", NAN),
        ("Ellipsoids ×", 0.0),
        ("Time [s]", NAN),
        ("Time [s]", "x"),
        ("Start [m]", [NAN, 0.0, 0.0]),
        ("Start [m]", [0.0, 0.0]),
        ("Start [m]", []),
        ("Goal yaw [°]", NAN),
        ("Click to place", "the moon"),
        ("Format", "exe"),
        ("Place", "/etc/passwd"),
    ],
)
def test_what_no_setting_can_be_never_reaches_the_session(widgets: dict[str, Any], label: str, bad: Any) -> None:
    assert not may_set(widgets[label], {"value": bad})


@pytest.mark.parametrize(
    ("label", "good"),
    [("Seed", 2**31 - 1), ("Push [cm]", 10.0), ("Twist [°]", 10.0), ("Opacity [%]", 5.0), ("Start [m]", [0.5, 0, 0.4])],
)
def test_what_a_setting_can_be_may_be_set(widgets: dict[str, Any], label: str, good: Any) -> None:
    assert may_set(widgets[label], {"value": good})
