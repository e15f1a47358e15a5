"""A hall with a floor, a trench through it and a table, for robots on the ground."""

from nerfnav.field.models.voxel import VoxelField
from tests.planner.objective.test_default_ends import Corners, field_of

FLOOR_M, TABLE_M = 0.1, 0.56
"""Heights of the floor and of the table [m]."""
_BOX: Corners = ((-1.5, -1.0, 0.0), (1.5, 1.0, 1.0))
_TABLE: Corners = ((-1.3, 0.3, 0.5), (-0.7, 0.9, TABLE_M))


def hall(floor_from: float = -1.0) -> VoxelField:
    """The hall, whose trench has no floor between x = 0.3 and 0.8 m; the floor is solid from a height [m] up."""
    before: Corners = ((-2.0, -2.0, floor_from), (0.3, 2.0, FLOOR_M))
    beyond: Corners = ((0.8, -2.0, floor_from), (2.0, 2.0, FLOOR_M))
    return field_of(_BOX, before, beyond, _TABLE)
