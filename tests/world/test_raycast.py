import numpy as np
import pytest
import torch
import trimesh
from PIL import Image
from trimesh.visual.color import ColorVisuals
from trimesh.visual.texture import TextureVisuals

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry.camera import Camera, look_at
from nerfnav.world.raycast import MeshRenderer, RayCaster, average
from nerfnav.world.surface import Paint, blend, surface_color

_DOWN = look_at(torch.tensor([0.0, 0.0, 1.0]), torch.tensor([0.0, 0.0, 0.0]))
_CAMERA = Camera.from_fov(40, 40, 90.0)


def _floor() -> trimesh.Trimesh:
    """A square of 2 m at z = 0, seen in full by a 90 degree camera 1 m above it."""
    corners = np.array([[-1, -1, 0], [1, -1, 0], [1, 1, 0], [-1, 1, 0]], float)
    return trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)


def _seen_points() -> torch.Tensor:
    """Where on the floor the camera's pixels look (1600, 2)."""
    origins, directions = _CAMERA.rays(_DOWN)
    return (origins - directions / directions[:, 2:])[:, :2]


def test_vertex_colours_are_interpolated_between_corners():
    floor = _floor()
    floor.visual = ColorVisuals(floor, vertex_colors=[[0, 0, 40], [200, 0, 40], [200, 100, 40], [0, 100, 40]])
    image = MeshRenderer(floor).render(_CAMERA, _DOWN).image.reshape(-1, 3)
    share = (_seen_points() + 1) / 2
    expected = torch.stack([200 * share[:, 0], 100 * share[:, 1], torch.full_like(share[:, 0], 40)], -1)
    assert (image - expected).abs().max() <= 1


def test_face_colours_stay_within_their_face():
    floor = _floor()
    floor.visual = ColorVisuals(floor, face_colors=[[255, 0, 0], [0, 0, 255]])
    image = MeshRenderer(floor).render(_CAMERA, _DOWN).image.reshape(-1, 3)
    points = _seen_points()
    lower = points[:, 0] > points[:, 1] + 1e-4
    assert (image[lower] == torch.tensor([255, 0, 0])).all()
    assert (image[points[:, 0] < points[:, 1] - 1e-4] == torch.tensor([0, 0, 255])).all()


def test_textures_are_looked_up_bilinearly_with_v_pointing_up():
    rows, columns = np.mgrid[0:16, 0:16]
    pixels = np.stack([10 * columns, 10 * rows, np.full((16, 16), 7)], -1).astype(np.uint8)
    floor = _floor()
    material = trimesh.visual.material.SimpleMaterial(image=Image.fromarray(pixels))
    floor.visual = TextureVisuals(uv=np.array([[0, 0], [1, 0], [1, 1], [0, 1]]), material=material)
    image = MeshRenderer(floor).render(_CAMERA, _DOWN).image.reshape(-1, 3).float()
    share = (_seen_points() + 1) / 2
    inner = ((share > 1 / 32) & (share < 31 / 32)).all(-1)
    red, green = 160 * share[:, 0] - 5, 160 * (1 - share[:, 1]) - 5
    expected = torch.stack([red, green, torch.full_like(red, 7)], -1)
    assert inner.sum() > 1000
    assert (image - expected)[inner].abs().max() <= 1


def test_rays_that_see_the_sky_change_no_colour_of_the_others():
    material = trimesh.visual.material.SimpleMaterial(image=Image.new("RGB", (2, 2), (200, 100, 50)))
    textured, plain, pixels = _floor(), _floor(), np.array([[[200, 100, 50]]], np.uint8)
    textured.visual = TextureVisuals(uv=np.zeros((4, 2)), material=material)
    paint = Paint((pixels,), np.zeros(2, np.int32), np.zeros((2, 3, 2), np.float32), np.full((2, 3, 3), 255, np.uint8))
    faces, weights = np.array([-1, 0, 1, -1], np.int32), np.full((4, 3), 1 / 3, np.float32)
    for color in (surface_color(textured), surface_color(plain), paint.color):
        assert np.array_equal(color(faces, weights)[1:3], color(faces[1:3], weights[1:3]))


def test_a_textured_mesh_is_tinted_by_its_material():
    floor = _floor()
    material = trimesh.visual.material.PBRMaterial(
        baseColorTexture=Image.new("RGB", (2, 2), (200, 100, 50)), baseColorFactor=[127, 255, 0, 255]
    )
    floor.visual = TextureVisuals(uv=np.zeros((4, 2)), material=material)
    image = MeshRenderer(floor).render(_CAMERA, _DOWN).image
    assert (image.float() - torch.tensor([200 * 127 / 255, 100.0, 0.0])).abs().max() <= 1


def test_depth_is_the_distance_along_each_ray_and_infinite_in_the_sky():
    tall = Camera.from_fov(30, 50, 90.0)
    picture = MeshRenderer(_floor(), sky=(0.2, 0.4, 0.6)).render(tall, _DOWN)
    assert picture.image.shape == (50, 30, 3)
    assert picture.depth.shape == (50, 30)
    _, directions = tall.rays(_DOWN)
    distance = -1 / directions[:, 2]
    points = distance[:, None] * directions
    on_floor = (points.abs() < 0.999)[:, :2].all(-1)
    depth = picture.depth.reshape(-1)
    assert torch.allclose(depth[on_floor], distance[on_floor], atol=1e-5)
    off_floor = (points.abs() > 1.001)[:, :2].any(-1)
    assert off_floor.any()
    assert depth[off_floor].isinf().all()
    assert (picture.image.reshape(-1, 3)[off_floor] == torch.tensor([51, 102, 153])).all()


def test_supersampling_averages_the_rays_of_a_pixel():
    floor = _floor()
    floor.visual = ColorVisuals(floor, face_colors=[[200, 0, 0], [0, 0, 200]])
    coarse, fine = Camera.from_fov(20, 20, 90.0), Camera.from_fov(40, 40, 90.0)
    averaged = MeshRenderer(floor, supersample=2).render(coarse, _DOWN).image.float()
    rays = MeshRenderer(floor).render(fine, _DOWN).image.float()
    assert (averaged - rays.reshape(20, 2, 20, 2, 3).mean((1, 3))).abs().max() <= 0.5


def test_a_supersampling_below_one_is_refused():
    with pytest.raises(InvalidInputError, match="supersample must be 1 or more"):
        MeshRenderer(_floor(), supersample=0)


def test_rays_that_meet_anything_are_occluded():
    caster = RayCaster(_floor())
    origins = np.array([[0.3, 0.1, 1.0], [0.3, 0.1, 1.0], [3.0, 0.0, 1.0]], np.float32)
    directions = np.array([[0, 0, -1], [0, 0, 1], [0, 0, -1]], np.float32)
    assert caster.occluded(origins, directions).tolist() == [True, False, False]
    distance = caster.first_hits(origins, directions).distance.tolist()
    assert distance == pytest.approx([1.0, np.inf, np.inf], rel=0, abs=1e-7)  # one rounding of a float


def test_a_closed_mesh_lets_no_ray_out():
    ball = trimesh.creation.icosphere(subdivisions=4)
    directions = np.random.default_rng(0).normal(size=(100_000, 3)).astype(np.float32)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    hits = RayCaster(ball).first_hits(np.zeros_like(directions), directions)
    assert (hits.face >= 0).all()
    assert np.allclose(hits.weights.sum(1), 1, atol=1e-5)


def test_a_material_without_a_texture_shows_its_colour():
    for material, expected in [
        (trimesh.visual.material.PBRMaterial(baseColorFactor=[10, 20, 30, 255]), [10, 20, 30]),
        (trimesh.visual.material.SimpleMaterial(diffuse=[40, 50, 60, 255]), [40, 50, 60]),
    ]:
        floor = _floor()
        floor.visual = TextureVisuals(uv=np.zeros((4, 2)), material=material)
        image = MeshRenderer(floor).render(_CAMERA, _DOWN).image
        assert (image.reshape(-1, 3) == torch.tensor(expected)).all()


def test_a_picture_that_is_taken_in_parts_is_the_same(monkeypatch: pytest.MonkeyPatch):
    floor = _floor()
    floor.visual = ColorVisuals(floor, vertex_colors=[[0, 0, 40], [200, 0, 40], [200, 100, 40], [0, 100, 40]])
    whole = MeshRenderer(floor).render(_CAMERA, _DOWN)
    monkeypatch.setattr("nerfnav.world.raycast._AT_ONCE", 37)
    parts = MeshRenderer(floor).render(_CAMERA, _DOWN)
    assert torch.equal(parts.image, whole.image) and torch.equal(parts.depth, whole.depth)


@pytest.mark.parametrize("kind", [np.float32, np.uint8])
def test_values_at_corners_are_blended_as_numpy_does_to_the_bit(kind: type):
    draws = np.random.default_rng(3)
    corners = draws.uniform(0, 255, (50, 3, 3)).astype(kind)
    faces, weights = draws.integers(0, 50, 4000).astype(np.int32), draws.dirichlet((1, 1, 1), 4000).astype(np.float32)
    found = np.empty((4000, 3), np.float32)
    blend(corners, faces, weights, found)
    first, second, third = (weights[:, k, None] * corners[faces][:, k] for k in range(3))
    assert np.array_equal(found, first + second + third)


@pytest.mark.parametrize("side", [1, 2, 3])
def test_the_rays_of_a_pixel_are_averaged_as_numpy_does_to_the_byte(side: int):
    draws, sky = np.random.default_rng(side), np.array([12.5, 255.0, 0.0], np.float32)
    colors = draws.integers(0, 1021, (40, side, 60, side, 3)).astype(np.float32) / 4  # many means end on a half
    seen = draws.random(colors.shape[:4]) < 0.7
    image = np.empty((40, 60, 3), np.uint8)
    average(colors, seen, sky, image)
    colors[~seen] = sky
    total = sum(colors[:, i, :, j] for i in range(side) for j in range(side))
    assert np.array_equal(image, (total / np.float32(side * side) + np.float32(0.5)).astype(np.uint8))


def test_a_renderer_follows_who_looks_through_another_camera():
    renderer, wide, narrow = MeshRenderer(_floor()), Camera.from_fov(20, 20, 120.0), Camera.from_fov(20, 20, 60.0)
    first = renderer.render(wide, _DOWN).depth
    assert renderer.render(narrow, _DOWN).depth.isfinite().all() and first.isinf().any()
    assert torch.equal(renderer.render(wide, _DOWN).depth, first)
