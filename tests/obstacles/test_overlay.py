"""Overlay of obstacles that move: drawn where they are nearer than what stands, and the pixels that they cover."""

from dataclasses import replace

import numpy as np
import torch

from nerfnav.geometry import FORWARD_MOUNT, Camera
from nerfnav.obstacles import BoxShape, ConstantVelocity, Obstacle, ObstacleSet, Overlay, Sphere, place_in_scene
from nerfnav.obstacles.motions import STILL
from nerfnav.robots import RigidState
from nerfnav.world import MeshRenderer
from tests.experiments.places import column

CAMERA = Camera.from_fov(48, 36, 80)
CRATE = Obstacle(
    "crate", BoxShape((0.2, 0.3, 0.2)), (-0.3, -0.3, 0.5), (0.1, 0.2, 0.3), ConstantVelocity((0.0, 0.5, 0.0)),
    (0.1, 0.7, 0.2),
)  # fmt: skip
BALL = Obstacle("ball", Sphere(0.1), (0.6, 0.3, 0.5), motion=ConstantVelocity((0.0, -0.3, 0.0)))
POSE = RigidState.at_rest((-0.9, 0.0, 0.5)).pose.compose(FORWARD_MOUNT)


def test_a_picture_shows_them_as_a_scene_that_holds_them_does() -> None:
    scene, overlay = column().scene, Overlay((CRATE, BALL))
    seen = MeshRenderer(scene, supersample=2).render(CAMERA, POSE)
    pictures = []
    for time in (0.0, 0.6, 1.4):
        drawn = overlay.draw(seen.image, seen.fine_depth, CAMERA, POSE, time)
        there = tuple(
            replace(each, position=tuple(each.place(np.array([time]))[0].tolist()), motion=STILL)
            for each in (CRATE, BALL)
        )
        wanted = MeshRenderer(place_in_scene(scene, ObstacleSet(there)), supersample=2).render(CAMERA, POSE).image
        off = (drawn.int() - wanted.int()).abs().amax(-1)
        assert (off <= 2).float().mean() > 0.99, "but for single pixels at edges it is the same picture"
        assert (drawn != seen.image).any()
        pictures.append(drawn)
    assert (pictures[0] != pictures[1]).any()


def test_what_stands_before_them_hides_them() -> None:
    seen = MeshRenderer(column().scene, supersample=2).render(CAMERA, POSE)
    behind = Overlay((Obstacle("ball", Sphere(0.1), (0.6, 0.0, 0.5), motion=ConstantVelocity((0.0, 1e-3, 0.0))),))
    assert torch.equal(behind.draw(seen.image, seen.fine_depth, CAMERA, POSE, 0.0), seen.image)


def test_covered_pixels_are_those_that_show_them_and_some_around() -> None:
    sky, far = torch.full((36, 48, 3), 200, dtype=torch.uint8), torch.full((36, 48), torch.inf)
    overlay = Overlay((CRATE,))
    drawn = (overlay.draw(sky, far, CAMERA, POSE, 0.5) != sky).any(-1)
    exact, more = overlay.covered(CAMERA, POSE, 0.5, around=0.0), overlay.covered(CAMERA, POSE, 0.5)
    assert torch.equal(drawn, exact) and 0 < exact.sum() < more.sum() < 36 * 48
    assert not (exact & ~more).any()
    away = RigidState.at_rest((-0.9, 0.0, 0.5), 3.1).pose.compose(FORWARD_MOUNT)
    assert not overlay.covered(CAMERA, away, 0.5).any()
