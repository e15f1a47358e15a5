from dataclasses import replace

import numpy as np
import pytest
import torch
import trimesh
from scipy.spatial import KDTree

import nerfnav_scenes as scenes
from nerfnav.core.errors import InvalidInputError
from nerfnav.core.steps import run_steps
from nerfnav.geometry.box import Box
from nerfnav.world.capture import CaptureConfig, capture, capture_poses, images_taken, photograph, split
from nerfnav.world.raycast import MeshRenderer
from nerfnav.world.scene import Scene
from nerfnav.world.solid import Solid
from tests.collected_steps import collect

_CONFIG = CaptureConfig(images=30, width=24, height=16, supersample=1)


def _generator() -> torch.Generator:
    return torch.Generator().manual_seed(0)


def test_cameras_keep_clear_of_the_mesh_and_are_never_inside_a_solid():
    scene = scenes.load("blocks")
    poses = capture_poses(scene, replace(_CONFIG, images=200), _generator())
    eyes = poses.position.double().numpy()
    distance, _ = KDTree(scene.mesh.vertices).query(eyes)
    assert distance.min() >= _CONFIG.clearance
    assert not np.any([Solid(mesh).contains(eyes) for mesh in scene.solids])


def test_cameras_stand_low_between_the_blocks_and_around_them():
    scene = scenes.load("blocks")
    eyes = capture_poses(scene, replace(_CONFIG, images=200), _generator()).position
    inside = scene.box.contains(eyes)
    assert 160 <= inside.sum() < 200
    assert (eyes[inside, 2] < 0.2).sum() > 40


def test_where_voxels_are_large_cameras_keep_further_off():
    config, place = CaptureConfig(), scenes.load("blocks")
    assert config.suiting(replace(place, voxel=None)) == config.suiting(replace(place, voxel=0.013)) == config
    assert config.suiting(replace(place, voxel=0.04)).clearance == pytest.approx(3.5 * 0.04)


def test_every_photograph_shows_more_than_sky():
    scene = scenes.load("blocks")
    for step in capture(scene, _CONFIG, _generator()):
        assert step.picture.depth.isfinite().float().mean() > 0.2


def test_a_capture_ends_with_all_photographs_and_repeats_for_a_seed():
    scene = scenes.load("blocks")
    (first, captured), (_, again) = (collect(capture(scene, _CONFIG, _generator())) for _ in range(2))
    assert captured.images.shape == (30, 16, 24, 3)
    assert torch.equal(captured.images, again.images)
    assert torch.equal(captured.images[3], first[3].picture.image)
    alike = photograph(MeshRenderer(scene), captured.camera, captured.poses[:4])
    assert torch.equal(alike.images, captured.images[:4])


def test_test_images_are_never_learnt_from():
    captured = run_steps(capture(scenes.load("blocks"), _CONFIG, _generator()))
    train, test = split(captured, every=10)
    assert (len(train), len(test)) == (27, 3)
    apart = torch.cdist(test.poses.position, train.poses.position)
    assert apart.min() > 1e-3


def test_a_scene_without_room_for_cameras_is_refused():
    with pytest.raises(InvalidInputError, match="too few places"):
        capture_poses(scenes.load("blocks"), replace(_CONFIG, clearance=2.0), _generator())


@pytest.mark.parametrize("count", [10, 150, 224, 360, 420])
def test_the_number_of_photographs_is_found_again_from_those_learned_from(count: int):
    learned = count - len(range(5, count, 10))
    assert images_taken(learned) == count


def test_some_cameras_around_a_long_place_stand_beyond_its_ends():
    scene = replace(scenes.load("blocks"), box=Box.of((-2.0, -0.5, -0.08), (2.0, 0.5, 0.6)))
    config = replace(_CONFIG, images=60, inside_share=0.0, seen_share=0.0)
    eyes = capture_poses(scene, config, _generator()).position
    assert (eyes[:, 0].abs() > 2.0).sum() >= 3
    assert (eyes[:, 1].abs() > 0.5).sum() >= 20


def test_where_the_box_is_full_all_cameras_look_in_from_around_it():
    cube = trimesh.creation.box((0.6, 0.6, 0.6))
    scene = Scene("cube", "Cube", cube, (cube,), Box.of((-0.3, -0.3, -0.3), (0.3, 0.3, 0.3)), (1.0, 1.0, 1.0), ())
    eyes = capture_poses(scene, replace(_CONFIG, images=20, seen_share=0.05), _generator()).position
    assert len(eyes) == 20
    assert not scene.box.contains(eyes).any()
