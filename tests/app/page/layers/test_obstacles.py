"""Handles of an obstacle: the pose or the size that a hand gives it; and its mesh in the scene."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import viser
import viser.transforms as tf

from nerfnav.navigation.seen_movers import SeenMovers
from nerfnav.obstacles import BoxShape, ConstantVelocity, Obstacle
from nerfnav.planner import Movers
from nerfnav_app.page.layers.movers import PATHS, MoversLayer
from nerfnav_app.page.layers.obstacles import HANDLES, ObstaclesLayer, follow_handles
from nerfnav_app.page.layers.sightings import NODE, SightingsLayer
from nerfnav_app.places.ends import default_ends
from nerfnav_app.state.flight import FlightRecord
from nerfnav_app.state.obstacles import GizmoMode, ObstacleKind, PlacedObstacle, new_obstacle
from nerfnav_app.state.session import Session
from tests.app.doubles import balls_place, flight_step

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


def test_what_moves_is_drawn_where_it_is_with_its_path_and_copies_of_it(server: viser.ViserServer) -> None:
    mover = BOX.with_way_point((0.1, 0.8, 0.3)).with_way_point((0.5, 0.8, 0.3))
    obstacles, movers = ObstaclesLayer(server, lambda _: None), MoversLayer(server)

    def shown(*placed: PlacedObstacle, **parts: object) -> dict[str, Any]:
        session = Session("balls", place=balls_place(), obstacles=placed, **parts)  # type: ignore[arg-type]
        for layer in (obstacles, movers):
            layer.show(session)
        return server.scene._handle_from_node_name

    nodes = shown(mover, chosen="box 1")
    assert nodes[HANDLES].visible and not nodes["/obstacles/1"].visible, "it is drawn twice"
    corners = [(0.1, 0.2, 0.3), (0.1, 0.8, 0.3), (0.5, 0.8, 0.3), (0.1, 0.2, 0.3)]  # a closed path
    np.testing.assert_allclose(nodes[PATHS].points[:, 0], corners[:-1], atol=1e-6)
    np.testing.assert_allclose(nodes[PATHS].points[:, 1], corners[1:], atol=1e-6)
    copies = nodes["/movers/1"].batched_positions  # 4 s at 0.5 m/s, where there is no plan
    np.testing.assert_allclose(copies, mover.obstacle.place(np.arange(1.0, 5.0)), atol=1e-6)
    nodes = shown(mover, chosen="box 1", motion_time=1.0)
    assert nodes["/obstacles/1"].visible and not nodes["/movers/1"].visible
    np.testing.assert_allclose(nodes["/obstacles/1"].position, (0.1, 0.7, 0.3), atol=1e-6)
    np.testing.assert_allclose(nodes[HANDLES].position, BOX.entry.position, atol=1e-6)
    nodes = shown(BOX, motion_time=1.0)
    assert "/movers/1" not in nodes and not nodes[PATHS].visible
    np.testing.assert_allclose(nodes["/obstacles/1"].position, BOX.entry.position, atol=1e-6)


def test_the_line_of_a_motion_without_way_points_ends_with_the_place(server: viser.ViserServer) -> None:
    bus, place = BOX.changed(motion={"velocity": (0.5, 0, 0)}), balls_place()
    MoversLayer(server).show(Session("balls", place=place, obstacles=(bus,)))
    paths: Any = server.scene._handle_from_node_name[PATHS]
    line = paths.points
    assert line[0, 0] == pytest.approx(BOX.entry.position) and 0.9 < line[..., 0].max() <= 1.0


def test_what_a_robot_suspects_is_drawn_where_it_is_by_now(server: viser.ViserServer) -> None:
    ends, layer = default_ends(balls_place(), None) or Session("balls").ends, SightingsLayer(server)
    comes = Obstacle("seen 1", BoxShape((0.1, 0.2, 0.3)), (0.0, 0.0, 0.2), motion=ConstantVelocity((1.0, 0.0, 0.0)))

    class Suspicion(SeenMovers):
        movers = Movers((comes,))

    step, kept = flight_step(ends, 1), replace(flight_step(ends, 1), kept_movers=Movers((comes,)))
    steps = (flight_step(ends, 0), replace(step, seen=Suspicion()), flight_step(ends, 2), kept, flight_step(ends, 4))
    node: Any = server.scene._handle_from_node_name[NODE]
    for count, visible in ((1, False), (2, True), (3, False), (4, True), (5, False)):
        session = Session("balls", place=balls_place(), ends=ends, flight=FlightRecord(ends, steps[:count]))
        layer.show(session)
        assert node.visible is visible
        if visible:
            np.testing.assert_allclose(node.batched_positions, [(0.1, 0.0, 0.2)], atol=1e-6)
            np.testing.assert_allclose(node.batched_scales, [(0.1, 0.2, 0.3)], atol=1e-6)
