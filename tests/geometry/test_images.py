"""Photographs with poses."""

import torch

from nerfnav.geometry.camera import Camera, Pose
from nerfnav.geometry.images import PosedImages


def test_a_subset_keeps_images_and_poses_together():
    images = torch.arange(4, dtype=torch.uint8)[:, None, None, None].expand(4, 2, 3, 3)
    poses = Pose(torch.eye(3).expand(4, 3, 3), torch.arange(4.0)[:, None].expand(4, 3))
    captured = PosedImages(images, Camera.from_fov(3, 2, 60), poses)
    assert len(captured) == 4
    for index, expected in (([3, 1], [3, 1]), (slice(2, None), [2, 3])):
        part = captured.subset(index)
        assert len(part) == 2
        assert part.images[:, 0, 0, 0].tolist() == expected
        assert part.poses.position[:, 0].tolist() == expected
