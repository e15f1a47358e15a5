import math
from dataclasses import replace

import numpy as np
import pytest
import torch
import trimesh

from nerfnav.core.errors import InvalidInputError
from nerfnav.experiments.field_geometry import GeometryConfig, measure_geometry, optical_depth, views
from nerfnav.field.models.analytic import BallsField
from nerfnav.geometry.box import Box
from nerfnav.geometry.camera import Camera, Pose, look_at
from nerfnav.world.scene import Scene

_RADIUS, _VOXEL = 0.3, 0.02
_BOX = Box.of((-0.6, -0.6, -0.6), (0.6, 0.6, 0.6))
_CAMERA = Camera.from_fov(100, 100, 90)
_CONFIG = GeometryConfig(surface_points=2000, free_points=4000)


@pytest.fixture(scope="module")
def scene() -> Scene:
    ball = trimesh.creation.icosphere(subdivisions=5, radius=_RADIUS)
    return Scene("ball", "Ball", ball, (ball,), _BOX, (1.0, 1.0, 1.0), ())


def _field(radius: float = _RADIUS, peak: float = 1000.0, softness: float = 1e-4) -> BallsField:
    return BallsField(_BOX, torch.zeros(1, 3), torch.tensor([radius]), softness, peak)


def _above(count: int) -> Pose:
    """Cameras 1 m above the ball, a little apart."""
    eyes = torch.tensor([[0.02 * k, 0.0, 1.0] for k in range(count)])
    return look_at(eyes, torch.zeros(count, 3))


def test_only_what_three_cameras_see_is_counted(scene: Scene):
    points = torch.tensor([[0.0, 0.0, _RADIUS], [0.0, 0.0, -_RADIUS]])
    assert views(scene.mesh, points, _CAMERA, _above(5), 0.01).tolist() == [5, 0]
    away = look_at(torch.tensor([[0.0, 0.0, 1.0]]), torch.tensor([[0.0, 0.0, 2.0]]))
    assert views(scene.mesh, points, _CAMERA, away, 0.01).tolist() == [0, 0]
    # of a ball seen from 1 m, the cap above z = r^2 / d shows: (1 - 0.3) / 2 of the surface
    report = measure_geometry(_field(), _VOXEL, scene, _CAMERA, _above(3), _CONFIG)
    assert report.surface_points / _CONFIG.surface_points == pytest.approx(0.35, abs=0.03)
    with pytest.raises(InvalidInputError, match="cannot judge the field"):
        measure_geometry(_field(), _VOXEL, scene, _CAMERA, _above(2), _CONFIG)


def test_optical_depth_is_the_density_inside_times_half_the_length():
    normal = torch.nn.functional.normalize(torch.tensor([[1.0, 2.0, -0.5]]), dim=-1)
    depth = optical_depth(_field(peak=100.0), _RADIUS * normal, normal, 0.06)
    assert depth.item() == pytest.approx(100 * 0.03, rel=0.03)


@pytest.mark.parametrize(("peak", "opaque", "solid"), [(20, 0, 0), (50, 1, 0), (200, 1, 1)])
def test_a_ball_is_opaque_from_the_density_on_that_three_voxels_ask_for(scene, peak: float, opaque: int, solid: int):
    report = measure_geometry(_field(peak=peak), _VOXEL, scene, _CAMERA, _above(3), _CONFIG)
    assert (report.surface_depth_1, report.surface_depth_2_3) == (opaque, solid)
    assert report.free_clear == 1
    assert report.voxel_m == _VOXEL


def test_a_field_whose_ball_is_two_voxels_too_small_has_no_surface_there(scene: Scene):
    report = measure_geometry(_field(_RADIUS - 2 * _VOXEL), _VOXEL, scene, _CAMERA, _above(3), _CONFIG)
    assert report.surface_depth_1 == 0


def test_fog_is_found_and_free_points_keep_three_voxels_away_and_out_of_the_ball(scene: Scene):
    around = scene.box.size.prod().item() - 4 / 3 * math.pi * (_RADIUS + 3 * _VOXEL) ** 3
    halo = replace(_field(), radii=torch.tensor([_RADIUS + 5 * _VOXEL]), peak=2.0)
    shell = 4 / 3 * math.pi * ((_RADIUS + 5 * _VOXEL) ** 3 - (_RADIUS + 3 * _VOXEL) ** 3)
    report = measure_geometry(halo, _VOXEL, scene, _CAMERA, _above(3), _CONFIG)
    expected = around / scene.box.size.prod().item()
    assert report.free_points / _CONFIG.free_points == pytest.approx(expected, abs=0.02)
    assert 1 - report.free_clear == pytest.approx(shell / around, abs=0.02)


def test_the_measure_draws_the_same_points_every_time(scene: Scene):
    soft = _field(softness=0.02)
    first, second = (measure_geometry(soft, _VOXEL, scene, _CAMERA, _above(3), _CONFIG) for _ in range(2))
    assert first == second
    assert np.isfinite(first.surface_depth_1)
