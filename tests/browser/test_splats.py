"""Splats that visitors bring are shown as they are, and flown in as a field."""

from collections.abc import Callable
from pathlib import Path

import numpy as np

from nerfnav.importers.splats.gaussians import splats_path
from nerfnav_app.server import App
from nerfnav_app.state.view import Backdrop
from tests.browser.tab import Tab
from tests.browser.test_uploads import opening_work
from tests.importers.splat_files import ball_of_splats, write_dot_splat


def test_uploaded_splats_are_shown_and_their_field_is_opened(
    serve: Callable[..., App], open_tab: Callable[[App], Tab], tmp_path: Path
) -> None:
    file = tmp_path / "moon.splat"
    write_dot_splat(file, ball_of_splats(400))
    app = serve(opening_work())
    tab = open_tab(app)
    tab.turn_to("Scene")
    first = app.session.place
    tab.upload("place.upload", file)
    tab.until(lambda: app.session.place is not first and app.session.job is None, "the splats were not opened")
    place = app.session.place
    assert place is not None and place.splats is not None and len(place.splats) == 400
    assert app.session.view_settings.backdrop is Backdrop.SPLATS
    assert splats_path(Path(app.session.what).with_suffix(".npz")).is_file()
    tab.until(lambda: tab.has_node("/splats") and tab.is_visible("/splats"), "the page does not show the splats")
    tab.until(lambda: not tab.is_visible("/field"), "the surface hides the splats")
    assert np.abs(place.field.box.center.numpy()).max() < 0.2
