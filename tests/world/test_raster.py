from typing import Any

import numpy as np
import pytest
import torch
import trimesh
from trimesh.visual.color import ColorVisuals

from nerfnav.geometry import Camera, Pose, so3
from nerfnav.world.raster import Hits, Rasteriser
from nerfnav.world.raycast import MeshRenderer, RayCaster

_CAMERA = Camera(150, 110, 80.0, 70.0, 60.0, 61.0)  # its middle is not that of the picture


def _pose(seed: int, reach: float = 1.0) -> Pose:
    """A camera anywhere near the origin, turned anyhow."""
    drawn = torch.randn(6, generator=torch.Generator().manual_seed(seed))
    return Pose(so3.exp(drawn[:3]), reach * drawn[3:])


def _triangles(seed: int, count: int, size: float) -> trimesh.Trimesh:
    """Triangles that have nothing to do with each other, all around the origin."""
    draws = np.random.default_rng(seed)
    middles = draws.normal(0, 3, (count, 1, 3))
    corners = middles + size * draws.normal(0, 1, (count, 3, 3))
    return trimesh.Trimesh(corners.reshape(-1, 3), np.arange(3 * count).reshape(-1, 3), process=False)


def _by_rays(mesh: trimesh.Trimesh, camera: Camera, pose: Pose) -> Hits:
    """The same by asking for each ray alone."""
    origins, directions = camera.rays(pose)
    return RayCaster(mesh).first_hits(origins.contiguous().numpy(), directions.numpy())


@pytest.mark.parametrize(("count", "size"), [(4000, 0.1), (300, 0.5), (20, 8.0)])
def test_what_is_seen_is_what_each_ray_hits_alone(count: int, size: float):
    """Also of triangles that reach behind the camera, and in front of which nothing is clipped."""
    for seed in range(4):
        mesh, pose = _triangles(seed, count, size), _pose(seed)
        found, expected = Rasteriser(mesh).first_hits(_CAMERA, pose), _by_rays(mesh, _CAMERA, pose)
        same = found.face == expected.face
        assert (~same).mean() < 2e-4  # rays along an edge
        hit = same & (found.face >= 0)
        assert hit.mean() > 0.1
        assert np.allclose(found.distance[hit], expected.distance[hit], rtol=2e-3)
        assert np.median(np.abs(found.distance[hit] / expected.distance[hit] - 1)) < 1e-5
        assert np.abs(found.weights[hit] - expected.weights[hit]).max() < 0.02
        assert np.median(np.abs(found.weights[hit] - expected.weights[hit])) < 1e-5
        assert np.isinf(found.distance[found.face < 0]).all()


def test_no_ray_slips_out_between_the_faces_of_a_closed_mesh():
    ball = trimesh.creation.icosphere(subdivisions=4)
    wide = Camera.from_fov(400, 400, 150)
    for seed in range(6):
        hits = Rasteriser(ball).first_hits(wide, _pose(seed, reach=0.2))
        assert (hits.face >= 0).all()
        assert np.allclose(hits.weights.sum(1), 1, atol=1e-6)
        assert (hits.weights > -1e-6).all()


def test_nothing_is_seen_of_what_is_behind_or_beside_the_camera():
    looking = Pose(torch.eye(3), torch.zeros(3))  # along -z
    for at in ([0, 0, 5], [40, 0, -5], [-40, 0, -5], [0, 40, -5], [0, -40, -5]):
        box = trimesh.creation.box(extents=(2, 2, 2)).apply_translation(at)
        assert (Rasteriser(box).first_hits(_CAMERA, looking).face == -1).all()


def test_faces_without_area_and_corners_that_are_nowhere_are_not_seen():
    corners = [[-1, -1, -2], [1, -1, -2], [0, 1, -2], [0, 0, -1], [np.nan, 0, -1]]
    mesh = trimesh.Trimesh(corners, [[0, 1, 2], [0, 1, 1], [3, 3, 3], [0, 1, 4]], process=False, validate=False)
    seen = Rasteriser(mesh).first_hits(_CAMERA, Pose(torch.eye(3), torch.zeros(3))).face
    assert set(seen.tolist()) == {-1, 0}


def test_of_two_faces_in_the_same_place_the_first_is_seen():
    corners = [[-1, -1, -2], [1, -1, -2], [0, 1, -2]]
    mesh = trimesh.Trimesh(corners, [[0, 1, 2]] * 3, process=False)
    raster, looking = Rasteriser(mesh), Pose(torch.eye(3), torch.zeros(3))
    for _ in range(2):
        assert set(raster.first_hits(_CAMERA, looking).face.tolist()) == {-1, 0}


def test_a_picture_does_not_depend_on_what_was_pictured_before():
    mesh = _triangles(5, 2000, 0.4)
    used = Rasteriser(mesh)
    for seed in range(5):
        found, expected = used.first_hits(_CAMERA, _pose(seed)), Rasteriser(mesh).first_hits(_CAMERA, _pose(seed))
        assert (found.face == expected.face).all()
        assert (found.weights == expected.weights).all()
        assert (found.distance == expected.distance).all()


def test_a_lens_that_bends_next_to_nothing_shows_what_a_pinhole_shows():
    ball = trimesh.creation.icosphere(subdivisions=3)
    drawn = np.random.default_rng(0).integers(0, 255, (len(ball.vertices), 3), dtype=np.uint8)
    ball.visual = ColorVisuals(ball, vertex_colors=drawn)
    lens = Camera(60, 60, 40.0, 40.0, 30.0, 30.0, (1e-6, 0.0, 0.0, 0.0))
    pinhole = Camera(60, 60, 40.0, 40.0, 30.0, 30.0)
    renderer, pose = MeshRenderer(ball, supersample=2), Pose(torch.eye(3), torch.tensor([0.1, 0.2, 2.5]))
    bent, straight = renderer.render(lens, pose), renderer.render(pinhole, pose)
    apart = (bent.image.int() - straight.image.int()).abs()
    assert (apart > 1).float().mean() < 0.01  # at the edge of the ball
    assert straight.image.float().std() > 20
    finite = bent.depth.isfinite() & straight.depth.isfinite()
    assert finite.any()
    assert torch.allclose(bent.depth[finite], straight.depth[finite], atol=1e-3)


@pytest.mark.parametrize(("count", "by_rays"), [(40, False), (400, True)])
def test_meshes_of_very_many_faces_are_asked_for_ray_by_ray(
    count: int, by_rays: bool, monkeypatch: pytest.MonkeyPatch
):
    asked: list[int] = []
    camera, pose = Camera.from_fov(5, 5, 90), _pose(1)
    renderer = MeshRenderer(_triangles(2, count, 0.5))
    monkeypatch.setattr(RayCaster, "first_hits", _counted(RayCaster.first_hits, asked))
    renderer.render(camera, pose)
    assert bool(asked) == by_rays


def _counted(first_hits: Any, asked: list[int]) -> Any:
    def counted(caster: RayCaster, origins: Any, directions: Any) -> Hits:
        asked.append(len(origins))
        return first_hits(caster, origins, directions)

    return counted
