"""What visitors bring through the browser ends as an opened place, or as one sentence."""

import tempfile
import threading
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import pytest
import torch

from nerfnav.field.storage.checkpoint import save_field
from nerfnav_app.jobs.open import opening as scene
from nerfnav_app.places.place import Place, open_place
from nerfnav_app.server import App
from nerfnav_app.state.place import ChooseQuality
from nerfnav_app.worker.backend import NavigationBackend
from tests.app.doubles import balls_place
from tests.browser.tab import Tab
from tests.importers.meshes.test_stray import room
from tests.waiting import PATIENCE_S


def opening_work(may_open: threading.Event | None = None) -> NavigationBackend:
    """Real jobs, which begin among three balls; other places are open once they may be."""

    def opener(what: str) -> Place:
        if what == "balls":
            return balls_place()
        assert may_open is None or may_open.wait(PATIENCE_S), "nobody looks at a page while a place is being opened"
        return open_place(what)

    return NavigationBackend(open=partial(scene.run, opener=opener))


def test_an_uploaded_field_is_opened_and_a_broken_one_leaves_the_place(
    serve: Callable[..., App], open_tab: Callable[[App], Tab], tmp_path: Path
) -> None:
    whole, broken = tmp_path / "mine.npz", tmp_path / "torn.npz"
    place = balls_place()
    save_field(replace(place.field, background=torch.tensor([0.1, 0.2, 0.3])), whole)
    broken.write_bytes(whole.read_bytes()[:1000])
    app = serve(opening_work())
    tab = open_tab(app)
    tab.turn_to("Scene")
    first = app.session.place
    tab.upload("place.upload", broken)
    tab.until(lambda: tab.says("is not a whole nerfnav field"), "the broken file is not refused")
    tab.until_idle()
    assert app.session.place is first and not tab.page.get_by_text(str(tempfile.gettempdir())).count()
    tab.upload("place.upload", whole)
    tab.until(lambda: app.session.place is not first and app.session.job is None, "the field was not opened")
    opened = app.session.place
    assert opened is not None and opened.name == "mine"
    np.testing.assert_allclose(opened.field.background, [0.1, 0.2, 0.3], atol=1e-6)
    tab.until(lambda: tab.has_node("/field") and tab.says("mine"), "the page does not show the field")


@pytest.mark.slow
def test_a_stray_part_of_a_mesh_is_left_out_where_the_user_presses_the_button(
    serve: Callable[..., App], open_tab: Callable[[App], Tab], tmp_path: Path
) -> None:
    app = serve(opening_work())
    app.post(ChooseQuality("draft"))
    tab = open_tab(app)
    tab.turn_to("Scene")
    tab.upload("place.upload", room(tmp_path, (0, 60, 0)))
    tab.until(lambda: tab.says("57.85 m away from the rest"), "the stray part is not named")
    assert not tab.says("--box")
    first = app.session.place
    tab.press("status.leave_out")
    tab.until(lambda: app.session.place not in (first, None), "it was not opened without the stray part", 120)
    place = app.session.place
    assert place is not None and place.field.box.size.max() < 8
    tab.until(lambda: not tab.says("away from the rest"), "the page still offers to leave it out")
