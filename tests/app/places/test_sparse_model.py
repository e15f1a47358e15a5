"""Cameras and points of structure from motion, as viewers show them."""

import numpy as np
import pytest

from nerfnav.core.glb import parts
from nerfnav.geometry import Box
from nerfnav.importers.captures.placement import estimate_up
from nerfnav.importers.core.progress import SparseModel
from nerfnav_app.places.sparse_model import encode_sparse_model
from nerfnav_app.places.surface_glb import read_box
from tests.importers.captures.synthetic import matrices, ring

POINT_CORNERS, CAMERA_CORNERS = 4, 5


def positions(glb: bytes) -> np.ndarray:
    document, binary = parts(glb)
    (primitive,) = document["meshes"][0]["primitives"]
    view = document["bufferViews"][primitive["attributes"]["POSITION"]]
    return np.frombuffer(binary, "<f4", view["byteLength"] // 4, view["byteOffset"]).reshape(-1, 3)


def test_cameras_and_points_stand_upright_however_the_model_lies() -> None:
    rng = np.random.default_rng(0)
    points = rng.uniform(-1, 1, (400, 3)) * [1.0, 1.0, 0.2]
    turned = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    turned *= np.sign(np.linalg.det(turned))
    poses = matrices(ring(12))
    poses[:, :3] = turned @ poses[:, :3]
    shown = encode_sparse_model(SparseModel(poses, points @ turned.T))
    corners = positions(shown)
    assert len(corners) > 350 * POINT_CORNERS + 12 * CAMERA_CORNERS
    assert abs(estimate_up(poses)[0] @ turned[:, 2]) > 0.99
    assert np.ptp(corners[:, 2]) < 0.5 * np.ptp(corners[:, 0]), "flat, as it is"
    assert read_box(shown) == ([-5.0] * 3, [5.0] * 3) == read_box(encode_sparse_model(SparseModel(5 * poses, points)))
    assert np.abs(corners).max() == pytest.approx(5, abs=0.3), "the box holds it, whatever its unit"


def test_what_is_in_metres_is_shown_where_it_is() -> None:
    points = np.random.default_rng(0).uniform(-1, 1, (400, 3))
    poses, box = matrices(ring(12)), Box.of((-1.0, -1.0, -1.0), (0.5, 1.0, 4.0))
    shown = encode_sparse_model(SparseModel(poses, np.concatenate([points, [[np.inf, 0, 0]]]), box))
    corners, held = positions(shown), int((points[:, 0] <= 0.5).sum())
    assert len(corners) == held * POINT_CORNERS + 12 * CAMERA_CORNERS, "points outside of the box are left out"
    assert read_box(shown) == (box.lower.tolist(), box.upper.tolist()), "the field will be seen in the same view"
    cameras = corners[-12 * CAMERA_CORNERS :: CAMERA_CORNERS]
    assert np.abs(cameras - poses[:, :3, 3]).max() < 1e-5


def test_points_that_are_wrong_and_too_many_are_left_out() -> None:
    rng = np.random.default_rng(0)
    points = np.concatenate([rng.uniform(-1, 1, (20_000, 3)), [[500.0, 0, 0]]])
    shown = encode_sparse_model(SparseModel(matrices(ring(5)), points))
    assert np.ptp(positions(shown), axis=0).min() > 3, "one that is far away makes the others no smaller"
    assert len(positions(shown)) <= 4000 * POINT_CORNERS + 5 * CAMERA_CORNERS


def test_two_cameras_without_points_are_shown() -> None:
    shown = encode_sparse_model(SparseModel(matrices(ring(2)), np.zeros((0, 3))))
    assert len(positions(shown)) == 2 * CAMERA_CORNERS
