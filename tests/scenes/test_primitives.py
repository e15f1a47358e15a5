import numpy as np
import pytest
import trimesh

from nerfnav.world.solid import winding_number
from scenes.light import Light, bake, from_srgb, to_srgb
from scenes.noise import fractal, noise, smoothstep
from scenes.primitives import box, disk, place, stone


def test_a_box_is_exact_watertight_and_finely_cut():
    mesh = box((0.3, 0.2, 0.1), edge=0.015)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(0.3 * 0.2 * 0.1)
    assert mesh.edges_unique_length.max() <= 0.015 * 2**0.5 + 1e-9


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_a_stone_is_watertight_and_does_not_cut_through_itself(seed: int):
    mesh = stone((0.08, 0.14, 0.3), edge=0.0135, seed=seed)
    assert mesh.is_watertight
    assert 0.6 < mesh.volume / (0.08 * 0.14 * 0.3) < 1.1
    points = np.random.default_rng(seed).uniform(mesh.bounds[0] - 0.01, mesh.bounds[1] + 0.01, (300, 3))
    numbers = winding_number(mesh.triangles, points)
    assert np.abs(numbers - numbers.round()).max() < 1e-6
    assert set(numbers.round().astype(int)) == {0, 1}


def test_a_disk_is_watertight_with_the_volume_of_a_polygonal_cylinder():
    mesh = disk(radius=0.5, thickness=0.05, edge=0.02)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(np.pi * 0.25 * 0.05, rel=0.005)
    assert mesh.bounds[1, 2] == 0


def test_a_shape_is_placed_with_its_foot_at_the_given_point():
    mesh = place(stone((0.1, 0.2, 0.3), 0.03, seed=0), (1.0, 2.0, 0.5), yaw=np.pi / 2)
    assert np.allclose(mesh.bounds.mean(0)[:2], [1.0, 2.0], atol=0.02)
    assert mesh.extents[0] > mesh.extents[1]
    assert mesh.bounds[0, 2] == pytest.approx(0.5, abs=0.02)


def test_noise_is_the_same_every_time_smooth_and_bounded():
    points = np.random.default_rng(0).uniform(-2, 2, (5000, 3))
    values = noise(points, 0.1, seed=3)
    assert np.array_equal(values, noise(points, 0.1, seed=3))
    assert not np.allclose(values, noise(points, 0.1, seed=4))
    assert (np.abs(values) < 1).mean() > 0.8
    assert 0.5 < values.std() < 0.9
    assert np.abs(noise(points + 1e-4, 0.1, seed=3) - values).max() < 0.01
    assert (np.abs(fractal(points, 0.1, seed=3)) < 1).mean() > 0.8


def test_smoothstep_runs_from_zero_to_one_either_way():
    assert smoothstep(0.0, 1.0, np.array([-1, 0.5, 2])).tolist() == [0, 0.5, 1]
    assert smoothstep(1.0, 0.0, np.array([-1, 0.5, 2])).tolist() == [1, 0.5, 0]


def test_dark_srgb_colours_survive_the_way_through_linear_light():
    colors = np.random.default_rng(0).uniform(0, 0.7, (100, 3))
    assert np.abs(to_srgb(from_srgb(colors)) / 255 - colors).max() < 0.003


def test_a_roof_keeps_sun_and_sky_off_the_ground_below_it():
    ground = box((2.0, 2.0, 0.1), edge=0.1)
    roof = place(box((1.0, 1.0, 0.05), edge=0.1), (0, 0, 0.15), 0)
    mesh = trimesh.util.concatenate([ground, roof])
    light = Light(elevation_deg=60.0)
    colors = bake(mesh, np.full((len(mesh.vertices), 3), 0.3), light).astype(int)
    top = np.isclose(mesh.vertices[:, 2], 0.05)
    below = top & (np.abs(mesh.vertices[:, :2]) < 0.2).all(-1)
    outside = top & (mesh.vertices[:, 0] < -0.85) & (np.abs(mesh.vertices[:, 1]) < 0.5)
    assert below.any() and outside.any()
    assert colors[below].max() < 0.6 * colors[outside].min()
    assert (colors[outside][:, 0] > colors[outside][:, 2]).all(), "the late sun is warm"
