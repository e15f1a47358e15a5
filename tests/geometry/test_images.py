"""Photographs with poses."""

import cv2
import numpy as np
import pytest
import torch

from nerfnav.geometry.camera import Camera, Pose
from nerfnav.geometry.images import PosedImages, downsample_image, encode_image, psnr_db


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


def test_a_picture_in_a_file_is_the_same_as_png_and_nearly_so_as_jpeg():
    across = np.linspace(0, 255, 24 * 32 * 3).reshape(24, 32, 3).astype(np.uint8)
    for content, most in ((encode_image(across), 0), (encode_image(across, jpeg_quality=95), 8)):
        again = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_COLOR)
        assert again is not None
        assert np.abs(again[..., ::-1].astype(int) - across).max() <= most


def test_each_pixel_of_a_reduced_picture_is_the_mean_over_its_area():
    image = torch.arange(4 * 6 * 3, dtype=torch.uint8).reshape(4, 6, 3)
    small = downsample_image(image, Camera.from_fov(3, 2, 60))
    expected = image.float().reshape(2, 2, 3, 2, 3).mean((1, 3)) / 255
    torch.testing.assert_close(small, expected.reshape(-1, 3))


def test_images_with_fewer_pixels_show_the_same_and_keep_what_their_masks_say():
    camera = Camera.from_fov(9, 6, 60)
    images = torch.arange(2 * 6 * 9 * 3).reshape(2, 6, 9, 3).remainder(250).to(torch.uint8)
    mask, shown = torch.ones(2, 6, 9, dtype=torch.bool), torch.zeros(2, 6, 9, dtype=torch.bool)
    mask[0, 0, 0], shown[1, 5, 8] = False, True
    poses = Pose(torch.eye(3).repeat(2, 1, 1), torch.zeros(2, 3))
    full = PosedImages(images, camera, poses, depth=torch.ones(2, 6, 9), silhouettes=shown, mask=mask)
    small = full.shrunk(4)
    assert small.images.shape == (2, 2, 3, 3) and (small.camera.width, small.camera.height) == (3, 2)
    assert small.camera.fx == pytest.approx(camera.fx / 3) and small.camera.cx == pytest.approx(1.5)
    assert torch.allclose(small.images[0, 1, 2].float(), images[0, 3:, 6:].float().mean((0, 1)), atol=1)
    assert small.mask is not None and small.mask.logical_not().nonzero().tolist() == [[0, 0, 0]]
    assert small.silhouettes is not None and small.silhouettes.nonzero().tolist() == [[1, 1, 2]]
    assert small.depth is full.depth and full.shrunk(9) is full


def test_a_tenth_of_full_scale_is_twenty_decibels_of_noise():
    assert psnr_db(0.1**2) == pytest.approx(20)
    assert psnr_db(0.0) == pytest.approx(100)
