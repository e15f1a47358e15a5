"""Splats in voxels: rays lose as much light in the field as in the splats."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.field.render.volume_rendering import render_rays
from nerfnav.geometry.box import Box
from nerfnav.importers.splats.formats import load_splats
from nerfnav.importers.splats.gaussians import Splats
from nerfnav.importers.splats.kernels.splatting import REACH, splat
from nerfnav.importers.splats.voxels import VoxelizeConfig, voxelize
from tests.importers.splat_files import ball_of_splats, write_inria

BOX = Box.of((-0.6, -0.6, -0.6), (0.6, 0.6, 0.6))


def one(scales: tuple[float, float, float], opacity: float) -> Splats:
    """A red splat in the middle."""
    covariance = np.diag(np.square(scales)).astype(np.float32)[None]
    rgb = np.array([[0.9, 0.2, 0.1]], np.float32)
    return Splats(np.zeros((1, 3), np.float32), covariance, rgb, np.array([opacity], np.float32), 1)


def rays(count: int, offset: float = 0.0) -> tuple[torch.Tensor, torch.Tensor]:
    """Rays down along z, `offset` [m] beside the middle in all directions."""
    turn = torch.arange(count) * 2 * math.pi / count + 0.1
    origins = torch.stack([offset * turn.cos(), offset * turn.sin(), torch.full((count,), 0.55)], -1)
    return origins, torch.tensor([[0.0, 0, -1]]).expand(count, 3)


@pytest.mark.parametrize("opacity", [0.2, 0.7, 0.95])
def test_a_ray_through_the_centre_loses_the_splats_opacity(opacity: float) -> None:
    field = voxelize(one((0.2, 0.15, 0.05), opacity), VoxelizeConfig(voxel=0.02, box=BOX))
    seen = render_rays(field, *rays(1))
    assert seen.opacity.item() == pytest.approx(opacity, abs=0.02)
    wanted = opacity * torch.tensor([0.9, 0.2, 0.1]) + (1 - opacity)
    torch.testing.assert_close(seen.color[0], wanted, rtol=0, atol=0.03)


def test_optical_depth_falls_off_beside_the_centre_as_the_gaussian_does() -> None:
    field = voxelize(one((0.15, 0.15, 0.05), 0.8), VoxelizeConfig(voxel=0.02, box=BOX))
    depth = -torch.log(1 - render_rays(field, *rays(8, 0.15)).opacity)
    torch.testing.assert_close(depth, torch.full((8,), -math.log(0.2) * math.exp(-0.5)), rtol=0.05, atol=0)


def test_a_splat_thinner_than_a_voxel_still_stops_its_light() -> None:
    field = voxelize(one((0.2, 0.2, 0.0005), 0.7), VoxelizeConfig(voxel=0.02, box=BOX))
    assert render_rays(field, *rays(1)).opacity.item() == pytest.approx(0.7, abs=0.05)


def test_the_kernel_is_the_sum_over_all_splats() -> None:
    rng = np.random.default_rng(0)
    factors = rng.normal(size=(6, 3, 3)) * 0.8
    covariances = factors @ factors.transpose(0, 2, 1) + 0.3 * np.eye(3)
    precisions = np.linalg.inv(covariances)
    centers, amplitudes, colors = rng.uniform(-1, 12, (6, 3)), rng.uniform(1, 5, 6), rng.uniform(0, 1, (6, 3))
    reaches = REACH * np.sqrt(np.diagonal(covariances, axis1=1, axis2=2))
    parts = (centers, precisions[:, *np.triu_indices(3)], reaches, amplitudes, colors)
    density, color = np.zeros((9, 11, 10), np.float32), np.zeros((9, 11, 10, 3), np.float32)
    splat(*(np.ascontiguousarray(part, np.float32) for part in parts), density, color)
    nodes = np.stack(np.meshgrid(*(np.arange(count) for count in density.shape), indexing="ij"), -1)
    offsets = nodes[..., None, :] - centers
    squares = np.einsum("...ki,kij,...kj->...k", offsets, precisions, offsets)
    each = np.where(squares <= float(REACH) ** 2, amplitudes * np.exp(-0.5 * squares), 0)
    np.testing.assert_allclose(density, each.sum(-1), rtol=1e-3, atol=0.02)  # those at the very end may differ
    np.testing.assert_allclose(color, each @ colors, rtol=1e-3, atol=0.02)


def test_a_ball_of_splats_is_an_opaque_ball_of_its_colours(tmp_path: Path) -> None:
    write_inria(tmp_path / "ball.ply", ball_of_splats(1500, radius=0.4))
    field = voxelize(load_splats(tmp_path / "ball.ply"), VoxelizeConfig(voxel=0.01), "ball.ply")
    seen = render_rays(field, *rays(12, 0.2))
    assert seen.opacity.min() > 0.97
    top = math.sqrt(0.4**2 - 0.2**2)
    torch.testing.assert_close(seen.depth, torch.full((12,), 0.55 - top), rtol=0, atol=0.03)
    torch.testing.assert_close(seen.color[:, 2], torch.full((12,), 0.5 + 0.4 * top / 0.4), rtol=0, atol=0.05)
    assert field.info.source == "ball.ply" and field.box.contains(torch.zeros(3))
    assert render_rays(field, *rays(4, 0.47)).opacity.max() < 0.1


def test_strays_far_away_do_not_stretch_the_box(tmp_path: Path) -> None:
    ball = ball_of_splats(1500, radius=0.4)
    ball.centers[:5] = [[50, 0, 0], [0, -80, 0], [0, 0, 90], [30, 30, 0], [0, 60, 60]]
    write_inria(tmp_path / "ball.ply", ball)
    field = voxelize(load_splats(tmp_path / "ball.ply"))
    assert field.box.size.max() < 1.2
    assert render_rays(field, *rays(12, 0.1)).opacity.median() > 0.97


@pytest.mark.parametrize(
    ("config", "reported"),
    [
        (VoxelizeConfig(voxel=1e-5, box=BOX), "choose larger"),
        (VoxelizeConfig(voxel=-1.0, box=BOX), "choose larger"),
        (VoxelizeConfig(box=replace(BOX, upper=BOX.lower)), "is empty"),
    ],
)
def test_impossible_grids_are_refused(config: VoxelizeConfig, reported: str) -> None:
    with pytest.raises(InvalidInputError, match=reported):
        voxelize(one((0.1, 0.1, 0.1), 0.5), config)


def test_a_grid_that_memory_cannot_hold_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("nerfnav.core.memory.available_memory", lambda: 10**6)
    with pytest.raises(InvalidInputError, match=r"a.spz: fitting .* of memory are free: choose larger ones"):
        voxelize(one((0.1, 0.1, 0.1), 0.5), VoxelizeConfig(voxel=0.01, box=BOX), "a.spz")
