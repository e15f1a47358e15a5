"""Components of free space, eroded."""

import numpy as np
import pytest
import scipy

from nerfnav.planner.space.regions import _eroded


@pytest.mark.parametrize("shape", [(23, 17, 12), (40, 30, 1), (2, 9, 3)])
@pytest.mark.parametrize("room", [0.0, 1.0, 2.5])
def test_erosion_leaves_what_is_farther_from_solid_space_and_the_border(shape: tuple[int, int, int], room: float):
    free = np.random.default_rng(1).random(shape) > 0.01
    spacing = np.array([0.081, 0.079, 0.08])
    padded = np.pad(free, [(1, 1) if count > 1 else (0, 0) for count in shape])
    distance = scipy.ndimage.distance_transform_edt(padded, spacing)
    inner = tuple(slice(1, -1) if count > 1 else slice(None) for count in shape)
    reach = room * float(spacing.max())
    assert np.array_equal(_eroded(free, reach, spacing), distance[inner] > reach)
