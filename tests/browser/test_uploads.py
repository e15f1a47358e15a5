"""What visitors bring through the browser ends as an opened place, or as one sentence."""

import tempfile
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import torch

from app.jobs import open_place as scene
from app.places.opening import open_place
from app.places.place import Place
from app.server import App
from app.worker.backend import NavigationBackend
from nerfnav.field.checkpoint import save_field
from tests.app.doubles import balls_place
from tests.browser.tab import Tab


def opening_work() -> NavigationBackend:
    """Real jobs, which begin among three balls."""

    def opener(what: str) -> Place:
        return balls_place() if what == "balls" else open_place(what)

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
    tab.upload("Open a file", broken)
    tab.until(lambda: tab.says("is not a whole nerfnav field"), "the broken file is not refused")
    assert app.session.place is first and not tab.page.get_by_text(str(tempfile.gettempdir())).count()
    tab.upload("Open a file", whole)
    tab.until(lambda: app.session.place is not first and app.session.job is None, "the field was not opened")
    opened = app.session.place
    assert opened is not None and opened.name == "mine"
    np.testing.assert_allclose(opened.field.background, [0.1, 0.2, 0.3], atol=1e-6)
    tab.until(lambda: tab.has_node("/field") and tab.says("mine"), "the page does not show the field")
