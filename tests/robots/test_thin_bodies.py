"""Bodies with thin parts: points over the thickness of each, room on every side, and what is refused."""

from pathlib import Path

import numpy as np
import pytest
import torch
import trimesh
from scipy.spatial import KDTree

from nerfnav.core.errors import InvalidInputError
from nerfnav.robots.body import Body
from nerfnav.robots.body_file import BodyFile, Cylinder, body_of
from nerfnav.robots.body_points import FINEST, MANY
from nerfnav.robots.surface import BodySurface
from tests.robots.thin import FIVE, SHAPES, cross, dense_surface, thin_body

VOXEL = 0.013
"""Distance of nodes in the paper's places [m]: nothing smaller is seen."""


def mast() -> trimesh.Trimesh:
    """A block with a mast of 1 cm."""
    pole = trimesh.creation.cylinder(0.005, 0.5).apply_translation((0, 0, 0.28))
    return trimesh.boolean.union([trimesh.creation.box((0.5, 0.4, 0.1)), pole])


def _outside(body: Body) -> np.ndarray:
    """How far its points are outside of its solid [m]; negative inside."""
    return -trimesh.proximity.signed_distance(body.solid, body.points_body.double().numpy())


@pytest.mark.slow
@pytest.mark.parametrize("shape", SHAPES)
def test_no_obstacle_of_a_voxel_passes_between_the_points_of_a_thin_part(shape: str):
    body = thin_body(shape)
    gaps = KDTree(body.points_body.numpy()).query(dense_surface(body, 0.004))[0]
    assert gaps.max() < (1.3 * VOXEL if shape == "spheres" else VOXEL) and len(body.points_body) < 1.1 * MANY


@pytest.mark.slow
def test_the_points_of_a_thin_body_are_in_it_and_reach_its_ends():
    for shape in ("spheres", "pole", "cross"):
        body = thin_body(shape)
        assert body.solid is not None and _outside(body).max() < 1e-4
        outermost = 2 * body.points_body.abs().amax(0)
        torch.testing.assert_close(outermost, torch.tensor(body.extents), atol=0.003, rtol=0)


def test_each_of_five_balls_has_points_all_around_it():
    points = thin_body("spheres").points_body
    for x, y, z, radius in FIVE:
        own = points[(points - torch.tensor((x, y, z))).norm(dim=-1) < 1.01 * radius]
        assert len(own) > 15 and (own.amax(0) - own.amin(0)).min() > 1.6 * radius


def test_only_the_thin_part_of_a_body_has_close_points():
    points = Body.from_mesh(mast(), 0.08).points_body.numpy()
    apart = KDTree(points).query(points, 2)[0][:, 1]
    pole = (points[:, 2] > 0) & (np.abs(points[:, :2]).max(1) < 0.006)
    assert apart[pole].max() < 0.02 < np.median(apart[~pole])
    assert len(points) < MANY


def test_a_grown_thin_body_reaches_further_on_the_sides_of_its_arms_too():
    body = thin_body("cross")
    grown, level = body.grown(0.01), body.grown(0.01, upright=False)
    assert grown.extents == pytest.approx((0.52, 0.52, 0.03)) and level.extents[2] == pytest.approx(0.01)
    assert grown.solid is not None and grown.solid.extents == pytest.approx((0.52, 0.52, 0.03))
    for each in (grown, level):
        amid = each.points_body[each.points_body[:, 0].abs() > 0.1]
        assert amid[:, 1].max() == pytest.approx(0.015, abs=1e-4)
    assert level.points_body[:, 2].max() == pytest.approx(0.005, abs=1e-4)


def test_a_compact_body_is_filled_and_grown_in_proportion_as_ever():
    body = Body.from_mesh(trimesh.creation.icosphere(subdivisions=3, radius=0.1), 0.02)
    assert body.push is None
    torch.testing.assert_close(body.grown(0.01).points_body, 1.1 * body.points_body, atol=1e-4, rtol=0)


def test_the_spacing_of_a_thin_box_follows_its_thickness_unless_it_is_given():
    assert body_of(BodyFile(box=(1.0, 0.01, 0.01)), Path())[1] == (round(1.0 / FINEST) + 1, 2, 2)
    assert body_of(BodyFile(box=(1.0, 0.01, 0.01), spacing=0.1), Path())[1] == (11, 2, 2)
    assert body_of(BodyFile(box=(0.25, 0.25, 0.08)), Path())[1] == (6, 6, 3)


def test_the_surface_of_a_mesh_has_its_edges_and_no_hollow_ones():
    box, arms = BodySurface.of_box((0.2, 0.1, 0.3)), BodySurface.of_mesh(cross())
    assert (len(box.corners), len(box.edges), len(box.faces)) == (8, 12, 12)
    length = float(np.linalg.norm(arms.edges[:, 1] - arms.edges[:, 0], axis=-1).sum())
    # of each arm: four edges along its two halves, four around each end; none upright where the arms meet
    assert length == pytest.approx(2 * (4 * (0.5 - 0.01) + 8 * 0.01), rel=1e-3)
    parts = box.divided(0.02)
    assert len(parts.faces) > 100 and np.cross(*np.diff(parts.faces, axis=1).swapaxes(0, 1)).shape[1] == 3


@pytest.mark.parametrize(
    ("entry", "said"),
    [
        (BodyFile(spheres=[(0, 0, 0, 0.0)]), "the lengths of a sphere are above 0 m"),
        (BodyFile(spheres=[(0, 0, 0, 0.1), (0, 0, 0, -0.1)]), "the lengths of a sphere are above 0 m"),
        (BodyFile(spheres=[(0, 0, 0, 0.1), (0.1, 0, 0, 0.0004)]), "a sphere is at least 1 mm thick, not 0.8 mm"),
        (BodyFile(box=(0.2, 0.2, 0.0005)), "a box is at least 1 mm thick, not 0.5 mm"),
        (BodyFile(cylinder=Cylinder(0.1, 0.0002)), "a cylinder is at least 1 mm thick, not 0.2 mm"),
        (BodyFile(mesh="sheet.stl"), "a part of the body is 0.5 mm thick, and 1 mm is the least"),
        (BodyFile(mesh="sheet.stl", spacing=0.001), "more than 5000 of them: take a larger spacing"),
        (BodyFile(cylinder=Cylinder(0.5, 1.0), spacing=0.02), "more than 5000 of them: take a larger spacing"),
        (BodyFile(box=(1, 1, 1), spacing=0.02), "at most 5000"),
    ],
)
def test_a_body_that_cannot_be_is_refused_in_one_sentence(entry: BodyFile, said: str, tmp_path: Path):
    trimesh.creation.box((0.3, 0.3, 0.0005)).export(tmp_path / "sheet.stl")
    with pytest.raises(InvalidInputError) as raised:
        body_of(entry, tmp_path)
    assert said in str(raised.value) and "\n" not in str(raised.value)
