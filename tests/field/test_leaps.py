"""How far rays leap over empty cells."""

import numpy as np
import scipy

from nerfnav.field.kernels.pose_descent import FARTHEST, leaps_over


def test_leaps_are_the_chessboard_distance_from_cells_with_a_dense_corner() -> None:
    raw = np.where(np.random.default_rng(0).random((13, 9, 11)) < 0.01, 0.0, -20.0).astype(np.float32)
    dense = np.zeros((12, 8, 10), bool)
    for corner in np.ndindex(2, 2, 2):
        window = tuple(slice(side, side + count) for side, count in zip(corner, dense.shape, strict=True))
        dense |= raw[window] >= -16
    expected = scipy.ndimage.distance_transform_cdt(~dense, metric="chessboard")
    assert 0 < dense.sum() < dense.size and expected.max() > 2
    np.testing.assert_array_equal(leaps_over(raw, np.float32(-16)), expected)


def test_a_grid_without_any_density_is_leapt_over_at_once() -> None:
    assert (leaps_over(np.full((4, 5, 6), -20.0, np.float32), np.float32(-16)) == FARTHEST).all()
