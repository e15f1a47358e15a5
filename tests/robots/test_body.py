"""What bodies are made of."""

from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh
from scipy.spatial import KDTree

from nerfnav.core.errors import InvalidInputError
from nerfnav.robots.body import Body


def test_the_points_of_a_box_fill_it_up_to_its_faces():
    body = Body.box((0.1, 0.2, 0.04), (5, 3, 2))
    assert body.points_body.shape == (30, 3)
    half = torch.tensor([0.05, 0.1, 0.02])
    torch.testing.assert_close(body.points_body.amax(0), half)
    torch.testing.assert_close(body.points_body.amin(0), -half)
    assert len(body.points_body.unique(dim=0)) == 30


def test_a_single_point_along_an_edge_lies_in_its_middle():
    body = Body.box((0.1, 0.1, 0.04), (2, 2, 1))
    assert not body.points_body[:, 2].any()


def test_the_body_fits_into_the_ball_of_its_radius():
    body = Body.box((0.1, 0.2, 0.04), (2, 2, 2))
    assert body.points_body.norm(dim=-1).max().item() == pytest.approx(body.radius)


def test_a_grown_body_reaches_further_on_every_side():
    grown = Body.box((0.1, 0.2, 0.04), (5, 3, 2)).grown(0.01)
    assert grown.extents == pytest.approx((0.12, 0.22, 0.06))
    torch.testing.assert_close(grown.points_body.amax(0), torch.tensor([0.06, 0.11, 0.03]))
    assert len(grown.points_body) == 30


def test_a_body_that_is_not_grown_upright_keeps_its_height():
    grown = Body.box((0.1, 0.2, 0.04), (5, 3, 2)).grown(0.01, upright=False)
    assert grown.extents == pytest.approx((0.12, 0.22, 0.04))
    torch.testing.assert_close(grown.points_body.amax(0), torch.tensor([0.06, 0.11, 0.02]))


@pytest.mark.parametrize("mesh", [
    trimesh.creation.box((0.3, 0.1, 0.1)), trimesh.creation.torus(0.15, 0.03), trimesh.creation.icosphere(3, 0.1)
], ids=["box", "ring", "ball"])  # fmt: skip
def test_the_points_of_a_mesh_fill_its_surface_and_its_inside(mesh: trimesh.Trimesh):
    body = Body.from_mesh(mesh, 0.02)
    assert body.extents == pytest.approx(mesh.extents) and body.solid is not None
    points, inside = KDTree(body.points_body.numpy()), body.solid.sample(2000, seed=1)
    assert points.query(inside)[0].max() < 0.02 * 3**0.5
    assert body.solid.contains(0.99 * body.points_body.numpy()).mean() > (0.5 if mesh.euler_number == 0 else 0.999)


def test_a_mesh_is_moved_so_that_its_middle_is_the_origin_and_its_file_gives_the_same_body(tmp_path: Path):
    mesh = trimesh.creation.cylinder(0.1, 0.05).apply_translation((3, 2, 1))
    mesh.export(tmp_path / "drum.stl")
    body, read = Body.from_mesh(mesh), Body.from_mesh(tmp_path / "drum.stl")
    assert body.points_body.mean(0).abs().max() < 1e-2
    assert read.extents == pytest.approx(body.extents, abs=1e-5)
    apart = KDTree(body.points_body.numpy()).query(read.points_body.numpy())[0]
    assert apart.max() < 0.02 * 3**0.5


def test_a_grown_mesh_reaches_further_on_every_side():
    grown = Body.from_mesh(trimesh.creation.icosphere(2, 0.1)).grown(0.01)
    assert grown.extents == pytest.approx((0.22, 0.22, 0.22)) and grown.solid is not None
    assert grown.solid.extents == pytest.approx((0.22, 0.22, 0.22))
    assert grown.points_body.norm(dim=-1).max() == pytest.approx(0.11, abs=1e-3)


@pytest.mark.parametrize(("mesh", "complaint"), [
    (trimesh.Trimesh(), "must have triangles"),
    (trimesh.Trimesh([[0, 0, 0], [np.nan, 0, 0], [0, 1, 0]], [[0, 1, 2]], process=False), "finite"),
    (trimesh.creation.box((300, 100, 100)), r"5 m long, not 300 m: is it in other units"),
    (trimesh.creation.box((0.001, 0.001, 0.001)), r"not 0\.001 m"),
    (trimesh.creation.box((1, 1, 1)), "take a larger spacing"),
    (trimesh.Trimesh([[0, 0, 0], [0.1, 0, 0], [0, 0.1, 0]], [[0, 1, 2]]), "must be closed"),
])  # fmt: skip
def test_what_cannot_be_a_body_is_refused_with_a_reason(mesh: trimesh.Trimesh, complaint: str):
    with pytest.raises(InvalidInputError, match=complaint):
        Body.from_mesh(mesh)


def test_an_open_mesh_may_be_taken_as_its_hull_and_an_unreadable_file_is_refused(tmp_path: Path):
    crate = trimesh.creation.box((0.2, 0.2, 0.1))
    crate.update_faces(crate.face_normals[:, 2] < 0.5)  # no lid
    assert Body.from_mesh(crate, hull=True).extents == pytest.approx((0.2, 0.2, 0.1))
    with pytest.raises(InvalidInputError, match="must be closed"):
        Body.from_mesh(crate)
    (tmp_path / "body.obj").write_bytes(b"\0\1")
    for path in (tmp_path / "body.obj", tmp_path / "missing.stl", tmp_path / "body.txt"):
        with pytest.raises(InvalidInputError):
            Body.from_mesh(path)


@pytest.mark.parametrize("spacing", [0.0, -1.0])
def test_points_must_be_some_way_apart(spacing: float):
    with pytest.raises(InvalidInputError, match="above 0 m"):
        Body.from_mesh(trimesh.creation.box((0.1, 0.1, 0.1)), spacing)
