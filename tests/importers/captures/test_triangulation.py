"""Points that photographs agree on, in a room whose walls are known."""

import math

import numpy as np
import pytest
import torch

from nerfnav.geometry.camera import Camera, Pose, look_at
from nerfnav.geometry.images import PosedImages
from nerfnav.importers.captures.placement import guess_box
from nerfnav.importers.captures.triangulation import triangulate_points

ROOM = np.array([[-2.0, -1.5, 0.0], [2.0, 1.5, 2.5]])
CAMERA = Camera.from_fov(160, 120, 70.0)


def painted(points: np.ndarray) -> np.ndarray:
    """Colours (n, 3) of walls: spots of many sizes, different everywhere."""
    generator = np.random.default_rng(5)
    value = np.zeros(len(points))
    for scale in (6.0, 12.0, 24.0, 48.0):
        for _ in range(6):
            way = generator.normal(size=3)
            value += np.sin(scale * points @ way / np.linalg.norm(way) + generator.uniform(0, 7)) / 6
    return np.stack([0.5 + 0.5 * value, 0.5 + 0.4 * value, 0.5 + 0.3 * value], -1).clip(0, 1)


def photographed(pose: Pose, plain: bool) -> np.ndarray:
    """The room's walls as a camera inside it sees them."""
    origins, directions = CAMERA.rays(pose)
    origin, ways = origins.reshape(-1, 3).double().numpy(), directions.reshape(-1, 3).double().numpy()
    distance = np.maximum((ROOM[0] - origin) / ways, (ROOM[1] - origin) / ways).min(-1)
    colors = np.full((len(ways), 3), 0.6) if plain else painted(origin + distance[:, None] * ways)
    return (255 * colors).astype(np.uint8).reshape(CAMERA.height, CAMERA.width, 3)


def panned(count: int = 36, plain: bool = False) -> tuple[PosedImages, np.ndarray]:
    """Photographs from around the middle of the room, all looking outwards; and their poses (n, 4, 4)."""
    poses, images = np.tile(np.eye(4), (count, 1, 1)), []
    for index in range(count):
        turn = 2 * math.pi * index / count
        out = torch.tensor([math.cos(turn), math.sin(turn), 0.0])
        eye = torch.tensor([0.0, 0.0, 1.2]) + 0.7 * out + torch.tensor([0.0, 0.0, 0.15 * (-1) ** index])
        pose = look_at(eye, eye + out + torch.tensor([0.0, 0.0, 0.2 * math.sin(3 * turn)]))
        poses[index, :3, :3], poses[index, :3, 3] = pose.rotation.numpy(), pose.position.numpy()
        images.append(photographed(pose, plain))
    world = torch.from_numpy(poses).float()
    pixels = torch.from_numpy(np.stack(images))
    return PosedImages(pixels, CAMERA, Pose(world[:, :3, :3].contiguous(), world[:, :3, 3].contiguous())), poses


@pytest.fixture(scope="module")
def room() -> tuple[PosedImages, np.ndarray]:
    return panned()


def test_points_that_pictures_agree_on_lie_on_the_walls(room: tuple[PosedImages, np.ndarray]):
    points = triangulate_points(room[0])
    off = np.abs(np.concatenate([points - ROOM[0], ROOM[1] - points], -1)).min(-1)
    assert len(points) > 300
    assert np.median(off) < 0.03 and np.quantile(off, 0.9) < 0.2


def test_the_box_of_cameras_that_pan_about_a_room_is_the_room(room: tuple[PosedImages, np.ndarray]):
    guessed = guess_box(*room)
    box = guessed.box
    assert "the pictures agree on" in guessed.around and len(guessed.points) > 300
    assert np.abs(box.lower.numpy() - ROOM[0]).max() < 0.4 and np.abs(box.upper.numpy() - ROOM[1]).max() < 0.4


def test_pictures_of_plain_walls_agree_on_nothing_and_the_cameras_give_the_box():
    photographs, poses = panned(12, plain=True)
    assert len(triangulate_points(photographs)) == 0
    assert guess_box(photographs, poses).around == "the cameras and what they look at"
