"""Obstacles: shapes against their meshes, motions against their bounds, sets at a time."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

from nerfnav.core.errors import InvalidInputError
from nerfnav.obstacles import (
    BoxShape,
    ConstantVelocity,
    Cylinder,
    MeshShape,
    Motion,
    Obstacle,
    ObstacleSet,
    Prism,
    RandomWalk,
    Shape,
    Sphere,
    Still,
    Trefoil,
    WayPoints,
)

L_SHAPE = Prism(((0.0, 0.0), (2.0, 0.0), (2.0, 0.5), (0.5, 0.5), (0.5, 1.5), (0.0, 1.5)), (-0.2, 0.7))
RING = MeshShape(trimesh.creation.annulus(0.3, 0.6, 0.5))
WAY = ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (1.0, 2.0, 0.0))
SHAPES = (BoxShape((0.4, 1.0, 2.0)), Sphere(0.7), Cylinder(0.4, 1.2), L_SHAPE, RING)
WALK = RandomWalk((-1.0, -1.0, 0.0), (1.0, 1.0, 0.5), 0.8, seed=3)
MOTIONS = (
    Still(),
    ConstantVelocity((0.3, -0.4, 0.0)),
    WayPoints(WAY, 0.5),
    WayPoints(WAY, 0.5, closed=True),
    WALK,
    Trefoil((3.0, 2.5, 3.0), 1.3, 4.7),
)  # fmt: skip


@pytest.mark.parametrize("shape", SHAPES, ids=lambda shape: type(shape).__name__)
def test_distances_are_those_of_the_mesh_and_the_support_is_that_of_its_corners(shape: Shape) -> None:
    shape = replace(shape)  # the copy is freed, and its cache with it
    rng = np.random.default_rng(0)
    points = rng.uniform(-1.5, 1.5, (1000, 3))
    mesh = shape.mesh()
    assert mesh.is_watertight and mesh.volume > 0
    rough = 0.02 if isinstance(shape, Sphere | Cylinder) else 1e-9  # of the mesh's sides
    found = shape.signed_distance(points)
    np.testing.assert_allclose(found, MeshShape(mesh).signed_distance(points), atol=rough)
    assert (found < 0).any() and (found > 0).any()
    directions = rng.normal(size=(20, 3))
    np.testing.assert_allclose(shape.support(directions), (directions @ mesh.vertices.T).max(1), atol=2 * rough)


@pytest.mark.parametrize("motion", MOTIONS, ids=lambda motion: type(motion).__name__)
def test_no_motion_is_faster_than_its_bound(motion: Motion) -> None:
    clock = np.linspace(0, 60, 60001)
    speed = np.linalg.norm(np.diff(motion.offset(clock), axis=0), axis=1) / np.diff(clock)
    assert speed.max() <= motion.speed_bound * (1 + 1e-6)
    assert speed.max() >= 0.95 * motion.speed_bound


def test_a_path_keeps_its_last_point_and_a_closed_one_returns() -> None:
    times = np.array([0.0, 1.0, 2.0, 100.0])
    np.testing.assert_allclose(WayPoints(WAY, 0.5).offset(times), [[0, 0, 0], [0.5, 0, 0], [1, 0, 0], [1, 2, 0]])
    period = (3 + 5**0.5) / 0.5
    closed = WayPoints(WAY, 0.5, closed=True)
    np.testing.assert_allclose(closed.offset(times + period), closed.offset(times), atol=1e-12)


def test_a_walk_stays_in_its_box_and_is_the_same_for_a_seed() -> None:
    times = np.linspace(0, 200, 2000)
    places = WALK.offset(times)
    assert (places >= (-1, -1, 0)).all() and (places <= (1, 1, 0.5)).all() and np.ptp(places, axis=0).min() > 0.2
    np.testing.assert_array_equal(places, replace(WALK).offset(times))


def placed() -> ObstacleSet:
    return ObstacleSet((
        Obstacle("crate", SHAPES[0], (1.0, 2.0, 0.5), (0.3, -0.2, 0.8), color=(1.0, 0.0, 0.5)),
        Obstacle("ball", SHAPES[1], (-1.0, 0.0, 0.5), motion=ConstantVelocity((0.5, 0.0, 0.0))),
    ))  # fmt: skip


def test_boxes_hold_the_meshes_at_each_time_in_each_frame() -> None:
    turn = 0.4
    axes = np.array([[np.cos(turn), np.sin(turn), 0.0], [-np.sin(turn), np.cos(turn), 0.0], [0.0, 0.0, 1.0]])
    for frame in (np.eye(3), axes):
        boxes = placed().boxes([0.0, 2.0], frame)
        for step, time in enumerate((0.0, 2.0)):
            for index, obstacle in enumerate(placed().obstacles):
                corners = obstacle.mesh(time).vertices @ frame.T
                slack = 0.01 if index else 1e-9
                middle, half = boxes.centers[step, index], boxes.halves[index]
                np.testing.assert_allclose(corners.min(0), middle - half, atol=slack)
                np.testing.assert_allclose(corners.max(0), middle + half, atol=slack)
    box = placed().box(2.0)
    assert box.lower[0] == pytest.approx(-0.7) and box.contains(box.center)


def test_the_distance_of_a_set_is_that_of_the_nearest_obstacle_where_it_is_then() -> None:
    obstacles = placed()
    crate = obstacles.obstacles[0].mesh()
    points = np.random.default_rng(1).uniform(-3, 3, (200, 3))
    ball = np.linalg.norm(points - [0.0, 0.0, 0.5], axis=1) - 0.7
    np.testing.assert_allclose(
        obstacles.signed_distance(points, 2.0), np.minimum(MeshShape(crate).signed_distance(points), ball), atol=1e-6
    )
    assert obstacles.speed_bound == 0.5 and [each.name for each in obstacles.moving] == ["ball"]
    assert crate.visual.vertex_colors[0].tolist() == [255, 0, 128, 255]


def test_nothing_without_a_size_is_an_obstacle() -> None:
    open_box = trimesh.creation.box((1, 1, 1))
    open_box.update_faces(np.arange(12) > 0)
    for make in (
        lambda: BoxShape((0.0, 1.0, 1.0)),
        lambda: Sphere(float("nan")),
        lambda: MeshShape(open_box),
        lambda: Prism(((0.0, 0.0), (1.0, 1.0), (1.0, 0.0), (0.0, 1.0)), (0.0, 1.0)),
        lambda: Prism(((0.0, 0.0), (1.0, 1.0), (2.0, 2.0)), (0.0, 1.0)),
        lambda: Obstacle("a", Sphere(1.0), (float("inf"), 0.0, 0.0)),
        lambda: ObstacleSet(tuple(Obstacle(str(index), Sphere(1.0), (0.0, 0.0, 0.0)) for index in range(1001))),
    ):
        with pytest.raises(InvalidInputError):
            make()
