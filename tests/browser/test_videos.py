"""A video that a visitor brings is posed in view, and its field is planned in."""

from collections.abc import Callable
from pathlib import Path

import pytest

from nerfnav_app.places.sources import BUDGETS_S
from nerfnav_app.server import App
from tests.browser.tab import Tab
from tests.browser.test_uploads import opening_work
from tests.importers.captures.test_video import film_playground


def test_an_uploaded_video_is_posed_in_view_and_planned_in(
    serve: Callable[..., App], open_tab: Callable[[App], Tab], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    for quality in BUDGETS_S:
        monkeypatch.setitem(BUDGETS_S, quality, 3.0)
    video = tmp_path / "walk.avi"
    film_playground(video, count=24, arc=2.0)
    app = serve(opening_work())
    tab = open_tab(app)
    tab.turn_to("Scene")
    first = app.session.place
    tab.upload("place.upload", video)
    tab.until(lambda: tab.says(" frames posed"), "the page does not say how many frames are posed")
    tab.until(lambda: app.session.place is not first and app.session.job is None, "the video was not opened")
    place = app.session.place
    assert place is not None and place.name == "walk"
    tab.press("status.next.start_plan")
    tab.until_planned()
