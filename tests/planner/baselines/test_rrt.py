"""Balls against meshes whose distances are known."""

import numpy as np
import trimesh

from nerfnav.planner.baselines.rrt import BallCheck

BOX = trimesh.creation.box(extents=(1.0, 1.0, 1.0))


def test_a_ball_fits_outside_and_farther_from_the_surface_than_its_radius() -> None:
    check = BallCheck(BOX, 0.1)  # twelve large triangles, whose centres lie far from most of the surface
    points = np.random.default_rng(0).uniform(-1, 1, (300, 3))
    distance = np.linalg.norm(np.maximum(np.abs(points) - 0.5, 0), axis=1)
    assert [check.fits(point) for point in points] == list(distance > 0.1)


def test_it_agrees_on_fine_meshes() -> None:
    ball = trimesh.creation.icosphere(subdivisions=4, radius=0.5)
    check = BallCheck(ball, 0.2)
    assert check.fits(np.array([0.0, 0.72, 0.0]))
    assert not check.fits(np.array([0.0, 0.69, 0.0]))
    assert not check.fits(np.array([0.0, 0.05, 0.0])), "inside"
    assert check.fits(np.array([3.0, 3.0, 3.0])), "far away"


def test_an_empty_mesh_leaves_room_everywhere() -> None:
    assert BallCheck(trimesh.Trimesh(), 0.1).fits(np.zeros(3))
