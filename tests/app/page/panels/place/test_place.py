"""The place panel while a field is learned."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import viser

from nerfnav_app.jobs.events import PlaceOpened
from nerfnav_app.page.panels.place.place import PlacePanel
from nerfnav_app.places.library import PlaceLibrary
from nerfnav_app.state.session import Session
from tests.app.doubles import balls_place
from tests.app.sessions import reports


def test_the_picture_of_a_training_fills_the_panel_until_the_place_opens(
    server: viser.ViserServer, tmp_path: Path
) -> None:
    panel = PlacePanel(server, lambda command: None, PlaceLibrary(tmp_path))
    session = Session.opening("room")
    panel.show(session)
    assert session.job is not None and not panel._picture.visible
    upright = np.full((80, 45, 3), 200, np.uint8)
    panel.show(replace(session, job=replace(session.job, picture=upright)))
    assert panel._picture.visible and panel._picture.image.shape == (280, 158, 3)
    assert (panel._picture.image == 200).all()
    panel.show(reports(session, PlaceOpened(balls_place())))
    assert not panel._picture.visible
