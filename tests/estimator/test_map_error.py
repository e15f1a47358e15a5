"""Map error, measured on held-out photographs."""

from dataclasses import replace

import pytest
import torch

from nerfnav.estimator import ColorNoise, measure_map_error
from nerfnav.estimator.map_error import fit_map_error
from nerfnav.field.render.volume_rendering import render_image
from nerfnav.geometry import PosedImages
from nerfnav.geometry.camera import FORWARD_MOUNT, Camera, Pose
from nerfnav.robots import RigidState
from tests.estimator.places import draws, voxel_balls

CAMERA = Camera.from_fov(120, 96, 80)


def photographs(shift: float) -> PosedImages:
    """Rendered ones, said to be taken so far to the left of where they were [m]."""
    poses = [RigidState.at_rest((-0.4 + 0.03 * index, 0.05, 0.28), 0.05 * index).pose.compose(FORWARD_MOUNT)
             for index in range(6)]  # fmt: skip
    images = [(255 * render_image(voxel_balls(), CAMERA, pose).color.clamp(0, 1)).round().to(torch.uint8)
              .reshape(CAMERA.height, CAMERA.width, 3) for pose in poses]  # fmt: skip
    said = [replace(pose, position=pose.position - shift * pose.rotation[:, 0]) for pose in poses]
    return PosedImages(torch.stack(images), CAMERA, Pose.stack(said))


@pytest.mark.parametrize("shift", [0.0, 0.02])
def test_the_map_error_is_the_distance_of_fits_from_the_poses_of_photographs(shift: float) -> None:
    map_error = measure_map_error(voxel_balls(), photographs(shift), ColorNoise(std=0.02), draws(0))
    std = torch.tensor(map_error).reshape(6, 6).diagonal().sqrt()
    assert std[0] == pytest.approx(shift, abs=0.003)
    assert (std[1:3] < 0.004).all() and (std[3:] < 0.006).all()


def test_errors_that_their_own_covariances_explain_are_not_counted_twice() -> None:
    generator, count = draws(1), 400
    reported = torch.diag_embed(torch.rand(count, 6, generator=generator).double() * 2 + 0.5)
    noise = reported.diagonal(dim1=1, dim2=2).sqrt() * torch.randn(count, 6, generator=generator).double()
    assert (fit_map_error(noise, reported).diagonal() < 0.4).all()
    biases = torch.tensor([3.0, 1.0, 2.0, 3.0, 1.0, 2.0]).double()
    errors = noise + biases * torch.randn(count, 6, generator=generator).double()
    torch.testing.assert_close(fit_map_error(errors, reported).diagonal().sqrt(), biases, rtol=0.2, atol=0.0)
