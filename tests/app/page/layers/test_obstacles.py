"""Handles of an obstacle: the pose or the size that a hand gives it; and its mesh in the scene."""

from dataclasses import replace

import numpy as np
import pytest
import viser
import viser.transforms as tf

from nerfnav_app.page.layers.obstacles import HANDLES, ObstaclesLayer, follow_handles
from nerfnav_app.state.obstacles import GizmoMode, ObstacleKind, PlacedObstacle, new_obstacle
from nerfnav_app.state.session import Session
from tests.app.doubles import balls_place

BOX = new_obstacle(ObstacleKind.BOX, "box 1", 0.2, (0.1, 0.2, 0.3)).changed(rotation=(0.0, 0.0, 0.5))


def test_handles_move_turn_and_scale() -> None:
    wxyz = tf.SO3.from_rpy_radians(0.1, -0.2, 0.3).wxyz
    moved = follow_handles(BOX, GizmoMode.MOVE, (0.5, 0.6, 0.7), wxyz)
    assert moved.entry.position == (0.5, 0.6, 0.7) and moved.entry.rotation == BOX.entry.rotation
    turned = follow_handles(BOX, GizmoMode.TURN, (0.5, 0.6, 0.7), wxyz)
    assert turned.entry.position == BOX.entry.position
    assert turned.entry.rotation == pytest.approx((0.1, -0.2, 0.3), abs=1e-4)
    np.testing.assert_allclose(turned.obstacle.attitude, tf.SO3(wxyz).as_matrix(), atol=1e-4)
    corner = np.array(BOX.entry.position) + BOX.obstacle.attitude @ (0.1, 0.2, 0.15)
    x, y, z = corner.tolist()
    scaled = follow_handles(BOX, GizmoMode.SCALE, (x, y, z), wxyz)
    assert scaled.entry.box == pytest.approx((0.2, 0.4, 0.3), abs=1e-3)


def test_the_layer_draws_what_is_not_hidden(server: viser.ViserServer) -> None:
    layer, other = ObstaclesLayer(server, lambda _: None), BOX.changed(name="box 2", position=(0, 0, 0.1))

    def shown(*placed: PlacedObstacle, **parts: object) -> dict[str, bool]:
        session = Session("balls", place=balls_place(), obstacles=placed, **parts)  # type: ignore[arg-type]
        layer.show(session)
        nodes = server.scene._handle_from_node_name
        return {name: node.visible for name, node in nodes.items() if name.startswith("/obstacles/")}

    first = shown(BOX, other, chosen="box 1")
    assert first == {HANDLES: True, f"{HANDLES}/body": True, "/obstacles/1": False, "/obstacles/2": True}
    scaling = shown(BOX, other, chosen="box 1", gizmo_mode=GizmoMode.SCALE)
    assert scaling == {HANDLES: True, f"{HANDLES}/body": False, "/obstacles/1": True, "/obstacles/2": True}
    hidden = shown(BOX, replace(other, hidden=True))
    assert hidden == {HANDLES: False, f"{HANDLES}/body": False, "/obstacles/1": True}
