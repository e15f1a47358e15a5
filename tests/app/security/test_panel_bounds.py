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
from tests.app.page.handles import named_handles
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
    """All widgets of the panels by name, as the page shows them for an open place."""
    posted: list[Command] = []
    kinds = (EndsPanel, EstimatePanel, ExportPanel, FlightSettingsWidgets, ViewSettingsPanel, TimelinePanel)
    panels = [kind(served.server, posted.append) for kind in kinds]
    panels.append(PlacePanel(served.server, posted.append, NoUploads()))  # type: ignore[arg-type]
    for panel in panels:
        panel.show(opened)
    return named_handles(panels)


@pytest.mark.parametrize(
    ("name", "bad"),
    [
        ("flight_settings_widgets.seed", -1),
        ("flight_settings_widgets.seed", -1.0),
        ("flight_settings_widgets.seed", 2**32),
        ("flight_settings_widgets.position", NAN),
        ("flight_settings_widgets.position", 11.0),
        ("flight_settings_widgets.attitude", INF),
        ("flight_settings_widgets.attitude", 12.0),
        ("flight_settings_widgets.speed", "as fast as light"),
        ("view_settings.backdrop", "the truth"),
        ("view_settings.opacity", -10.0),
        ("view_settings.clip", 101.0),
        ("view_settings.height", NAN),
        ("estimate.ellipsoid", 0.0),
        ("timeline.slider", NAN),
        ("timeline.slider", "x"),
        ("ends.numbers.start.position", [NAN, 0.0, 0.0]),
        ("ends.numbers.start.position", [0.0, 0.0]),
        ("ends.numbers.start.position", []),
        ("ends.numbers.goal.yaw", NAN),
        ("ends.aim", "the moon"),
        ("export.format", "exe"),
        ("place.places", "/etc/passwd"),
    ],
)
def test_what_no_setting_can_be_never_reaches_the_session(widgets: dict[str, Any], name: str, bad: Any) -> None:
    assert not may_set(widgets[name], {"value": bad})


@pytest.mark.parametrize(
    ("name", "good"),
    [
        ("flight_settings_widgets.seed", 2**31 - 1),
        ("flight_settings_widgets.position", 10.0),
        ("flight_settings_widgets.attitude", 10.0),
        ("view_settings.opacity", 5.0),
        ("ends.numbers.start.position", [0.5, 0, 0.4]),
    ],
)
def test_what_a_setting_can_be_may_be_set(widgets: dict[str, Any], name: str, good: Any) -> None:
    assert may_set(widgets[name], {"value": good})
