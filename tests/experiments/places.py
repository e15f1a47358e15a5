"""A small arena: a square column in the middle of an empty box, as a mesh and as a field."""

from functools import cache

import torch
import trimesh

from nerfnav.experiments.arena import Arena
from nerfnav.field.models.voxel import EMPTY_RAW, VoxelField
from nerfnav.geometry.box import Box
from nerfnav.world.scene import Scene
from nerfnav.world.task import Task

BOX = Box.of((-1, -1, 0), (1, 1, 1))
TASKS = (
    Task("Around the column", (-0.7, 0.05, 0.5), (0.7, 0.0, 0.5)),
    Task("Along the wall", (-0.7, -0.7, 0.4), (0.7, -0.7, 0.5)),
)
PAST = Task("Past the column, in view of it", (-0.8, 0.1, 0.5), (-0.45, 0.1, 0.5), 0.0, 0.0)


@cache
def column() -> Arena:
    """The column is 0.4 m wide and as high as the box."""
    values = torch.full((41, 41, 21, 4), EMPTY_RAW)
    values[16:25, 16:25, :, 0] = 1.0
    mesh = trimesh.creation.box(extents=(0.4, 0.4, 1.0)).apply_translation((0, 0, 0.5))
    scene = Scene("column", "Column", mesh, (mesh,), BOX, (0.5, 0.6, 0.7), TASKS)
    return Arena(scene, VoxelField(BOX, values, torch.ones(3)))
