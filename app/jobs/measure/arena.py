"""Arena of experiments: a scene with its trained field."""

from functools import cache
from pathlib import Path

from nerfnav.core.errors import InvalidInputError
from nerfnav.experiments import Arena
from nerfnav.field import VoxelField
from nerfnav_app.places.obstacles import open_with_obstacles, require_standing
from nerfnav_app.places.place import open_place


@cache
def open_arena(place: str, obstacles: Path | None = None) -> Arena:
    """A scene with its trained field, and with the obstacles of a file in both, opened once in each process.

    Raises InvalidInputError without a ground truth, and for obstacles that cannot be placed, or move.
    """
    opened = open_place(place)
    if obstacles is not None:
        require_standing(obstacles)
        opened = open_with_obstacles(opened, obstacles)
    if opened.scene is None:
        raise InvalidInputError(f"experiments are judged on a ground truth, and {place} has none: name a scene")
    if not isinstance(opened.field, VoxelField):
        raise InvalidInputError(f"experiments fly in voxel fields: run `nerfnav bake {place}` first")
    return Arena(opened.scene, opened.field)
