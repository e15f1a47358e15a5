import numpy as np
import pytest
import trimesh

from nerfnav.world.solid import winding_number
from nerfnav_scenes.finishes import masonry, stained, tiles, wood
from nerfnav_scenes.light import Glass, Light, bake, from_srgb, to_srgb
from nerfnav_scenes.noise import fractal, noise, smoothstep
from nerfnav_scenes.primitives import bar, box, cut, disk, fused, panel, place, ring, stone, turned
from nerfnav_scenes.walls import Opening, Wall, arch, lancet, level, rose


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


def test_a_turned_shape_has_the_volume_of_its_profile():
    mesh = turned(0.3, lambda z: 0.05 + 0.1 * z, edge=0.008)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(np.pi * 0.3 * (0.05**2 + 0.05 * 0.08 + 0.08**2) / 3, rel=0.02)


def test_a_bar_joins_two_points():
    mesh = bar((0.1, 0.2, 0.0), (0.4, 0.6, 0.0), radius=0.02, edge=0.01)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(np.pi * 0.02**2 * 0.5, rel=0.05)
    assert np.allclose(mesh.bounds[1] - mesh.bounds[0], [0.3 + 0.04 * 0.8, 0.4 + 0.04 * 0.6, 0.04], atol=0.003)


def test_a_ring_is_watertight_and_open_in_the_middle():
    mesh = ring(np.array([[0.14, 0.0], [0.18, 0.0], [0.18, 0.4], [0.14, 0.4]]), edge=0.013)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(np.pi * (0.18**2 - 0.14**2) * 0.4, rel=0.01)
    assert np.linalg.norm(mesh.vertices[:, :2], axis=1).min() > 0.139


def test_a_panel_under_an_arch_has_the_area_that_the_arch_leaves():
    mesh = panel((-0.2, 0.2), 0.05, arch((-0.2, 0.2), 0.0, point=0.5), lambda x: 0 * x + 0.3, edge=0.01)
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(0.05 * (0.4 * 0.3 - np.pi * 0.2**2 / 2), rel=0.01)


def test_fused_boxes_lose_what_is_inside():
    first, second = box((0.2, 0.2, 0.2), 0.05), box((0.2, 0.2, 0.2), 0.05).apply_translation([0.1, 0, 0])
    mesh = fused([first, second])
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(0.3 * 0.2 * 0.2)
    assert mesh.area == pytest.approx(2 * (0.3 * 0.2 * 2 + 0.2 * 0.2))


def test_a_hole_that_is_cut_leaves_a_watertight_rest_and_no_seams():
    wall, hole = box((1.0, 0.1, 1.0), 0.05), box((0.4, 0.3, 0.5), 1.0)
    mesh = cut(wall, [hole])
    assert mesh.is_watertight
    assert mesh.volume == pytest.approx(0.1 * (1.0 - 0.4 * 0.5))
    inside = (np.abs(mesh.vertices[:, [0, 2]]) < (0.199, 0.249)).all(-1)
    assert not inside.any()


def test_a_wall_with_openings_is_watertight_and_its_glass_fills_the_windows_alone():
    door = (-0.6, -0.4)
    openings = {door: [Opening(level(-0.1), arch(door, 0.2))], **dict([lancet(0.0, 0.2, 0.2, 0.3)])}
    openings[(0.3, 0.6)] = [rose(0.45, 0.4, 0.15)]
    wall = Wall((-1, 1), 0.06, 0.0, level(0.7), openings)
    stones = wall.stones(lambda points: np.ones_like(points), 0.02)
    panes = wall.panes(lambda points: np.ones_like(points), 0.02, 0.02)
    assert stones.mesh.is_watertight
    assert len(panes) == 2 and all(pane.glass and pane.mesh.is_watertight for pane in panes)
    probes = np.array([[-0.5, 0.0, 0.1], [0.0, 0.0, 0.3], [0.45, 0.0, 0.4], [-0.8, 0.0, 0.1], [0.0, 0.0, 0.1]])
    assert np.round(winding_number(stones.mesh.triangles, probes)).tolist() == [0, 0, 0, 1, 1]
    inside = sum(np.round(winding_number(pane.mesh.triangles, probes)) for pane in panes)
    assert inside.tolist() == [0, 1, 1, 0, 0]


def test_sun_through_glass_takes_on_its_colour_and_glass_throws_no_shadow():
    floor = box((2.0, 2.0, 0.1), edge=0.1)
    pane = place(box((1.0, 1.0, 0.05), edge=0.1), (0, 0, 0.3), 0)
    light = Light(elevation_deg=80.0, sky=(0.0, 0.0, 0.0), bounce=(0.0, 0.0, 0.0), sun=(1.0, 1.0, 1.0))
    albedo = np.full((len(floor.vertices), 3), 0.3)
    red = np.tile([1.0, 0.2, 0.0], (len(pane.vertices), 1))
    colors = bake(floor, albedo, light, Glass(pane, red))
    clear = bake(floor, albedo, light)
    top = np.isclose(floor.vertices[:, 2], 0.05)
    below = top & (np.abs(floor.vertices[:, :2]) < 0.3).all(-1)
    beside = top & (floor.vertices[:, 0] > 0.8)
    assert np.array_equal(colors[beside], clear[beside])
    assert np.array_equal(colors[below][:, 0], clear[below][:, 0])
    assert (colors[below][:, 2] == 0).all()


def test_through_a_ceiling_that_glows_the_sky_falls_but_no_sun():
    floor = box((2.0, 2.0, 0.1), edge=0.1)
    pane = place(box((3.0, 3.0, 0.05), edge=0.1), (0, 0, 0.3), 0)
    albedo = np.full((len(floor.vertices), 3), 0.3)
    glass = Glass(pane, np.ones((len(pane.vertices), 3)))
    top = np.isclose(floor.vertices[:, 2], 0.05) & (np.abs(floor.vertices[:, :2]) < 0.8).all(-1)
    without_sun = Light(elevation_deg=80.0, sun=(0.0, 0.0, 0.0))
    below = bake(floor, albedo, Light(elevation_deg=80.0, sun_through_glass=False), glass)[top]
    assert np.array_equal(below, bake(floor, albedo, without_sun)[top])
    assert (below < bake(floor, albedo, Light(elevation_deg=80.0), glass)[top]).all()


@pytest.mark.parametrize("finish", [
    lambda points: masonry(points, (0.7, 0.6, 0.5), 1),
    lambda points: wood(points, (0.6, 0.4, 0.2), 1),
    lambda points: tiles(points, ((0.7, 0.4, 0.3), (0.8, 0.8, 0.7)), 0.1, 1),
    lambda points: stained(points, ((0.9, 0.1, 0.1), (0.1, 0.1, 0.9), (0.9, 0.8, 0.2)), 1),
])  # fmt: skip
def test_finishes_vary_within_a_few_centimetres(finish):
    grid = np.stack(np.meshgrid(np.linspace(0, 0.5, 60), np.linspace(0, 0.5, 60)), -1).reshape(-1, 2)
    points = np.stack([grid[:, 0], 0.3 * grid[:, 1], grid[:, 1]], -1)
    colors = finish(points)
    assert colors.shape == points.shape
    assert colors.min() >= 0
    shades = to_srgb(colors).astype(float).mean(-1).reshape(60, 60)
    assert np.abs(shades[5:] - shades[:-5]).mean() > 6
