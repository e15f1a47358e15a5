from dataclasses import replace

import pytest
import torch
import trimesh

import nerfnav_scenes as scenes
from nerfnav.geometry.box import Box
from nerfnav.world.capture import CaptureConfig, capture_poses
from nerfnav.world.raycast import RayCaster
from nerfnav.world.scene import Scene, Vantage
from nerfnav.world.vantage import filter_vantage, guess_vantage

_BOX = Box.of((-4.0, -3.0, 0.0), (4.0, 3.0, 3.0))


def _room(roof: bool = True) -> trimesh.Trimesh:
    room = trimesh.creation.box(bounds=[[-4, -3, 0], [4, 3, 3]])
    room.invert()
    if not roof:
        room.update_faces(room.face_normals[:, 2] > -0.5)
    return room


@pytest.mark.parametrize(("name", "vantage"), [("church", Vantage.INSIDE), ("stonehenge", Vantage.OUTSIDE)])
def test_a_church_is_a_room_and_stonehenge_is_not(name: str, vantage: Vantage):
    scene = scenes.load(name)
    assert guess_vantage(scene.mesh, scene.box) is vantage


@pytest.mark.parametrize("roof", [True, False])
def test_a_room_is_one_with_and_without_its_roof(roof: bool):
    assert guess_vantage(_room(roof), _BOX) is Vantage.INSIDE


def test_a_wall_on_flat_ground_is_no_room():
    ground = trimesh.creation.box(bounds=[[-4, -3, -0.1], [4, 3, 0]])
    wall = trimesh.creation.box(bounds=[[-2, -0.1, 0], [2, 0.1, 3]])
    assert guess_vantage(trimesh.util.concatenate([ground, wall]), _BOX) is Vantage.OUTSIDE


def test_cameras_of_a_room_stand_in_it_and_those_of_open_ground_above_it():
    points = torch.tensor([[0.0, 0.0, 1.5], [0.0, 0.0, -1.0], [6.0, 0.0, 1.5]])
    room = RayCaster(_room())
    assert filter_vantage(room, points, Vantage.INSIDE).tolist() == [True, False, False]
    assert filter_vantage(room, points, Vantage.ANYWHERE).tolist() == [True, True, True]
    ground = RayCaster(trimesh.creation.box(bounds=[[-40, -30, -0.1], [40, 30, 0]]))
    assert filter_vantage(ground, points, Vantage.OUTSIDE).tolist() == [True, False, True]


def test_a_capture_of_a_room_has_no_camera_outside():
    room = _room()
    around = Box.of((-8.0, -6.0, -1.0), (8.0, 6.0, 5.0))
    scene = Scene("room", "Room", room, (), around, (1.0, 1.0, 1.0), (), sheets=(room,), vantage=Vantage.INSIDE)
    config = CaptureConfig(images=40, width=24, height=16, supersample=1)
    eyes = capture_poses(scene, config, torch.Generator().manual_seed(0)).position
    assert _BOX.contains(eyes).all()
    anywhere = replace(scene, vantage=Vantage.ANYWHERE)
    eyes = capture_poses(anywhere, config, torch.Generator().manual_seed(0)).position
    assert not _BOX.contains(eyes).all()
