"""The first view of what is opened, before there is a field."""

from dataclasses import replace

import numpy as np
import pytest
import viser

from nerfnav.importers.sfm.pose_pictures import sparse_model
from nerfnav_app.page.layers.field_surface import FieldSurfaceLayer, first_view
from nerfnav_app.places.sparse_model import encode_sparse_model
from nerfnav_app.state.session import Session
from tests.importers.sfm.fake_posing import made


def test_the_first_cameras_and_points_are_looked_at_and_those_that_follow_leave_the_view(
    server: viser.ViserServer,
) -> None:
    layer, session = FieldSurfaceLayer(server), Session.opening("walk.mp4")
    layer.show(session)
    layer.show(replace(session, surface=encode_sparse_model(sparse_model(made(5, 5)))))
    eye, _ = first_view(([-5.0] * 3, [5.0] * 3))
    assert np.asarray(server.initial_camera.position) == pytest.approx(eye)
    server.initial_camera.position = (1.0, 2.0, 3.0)
    layer.show(replace(session, surface=(glb := encode_sparse_model(sparse_model(made(9, 9))))))
    assert tuple(server.initial_camera.position) == (1.0, 2.0, 3.0)
    assert layer.surface == glb
