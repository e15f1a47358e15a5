"""Measure again how far off the filter finds positions in the fields of the bundled worlds, and note it in them.

    python -m nerfnav_scenes.measure stonehenge church

Nothing is learned: only `FieldInfo.position_floor_m` changes, by flights that look at the world. To be run after a
field was trained, or where the filter finds positions better than before. Fields are replaced in trained/.
"""

import sys
from dataclasses import replace

import nerfnav_scenes as scenes
from nerfnav.experiments import Arena
from nerfnav.experiments.map_error import position_floor
from nerfnav.field import VoxelField, load_field, save_field
from nerfnav_scenes.named import for_named


def main(names: list[str]) -> None:
    """Do so for the fields of some scenes."""
    for name in names:
        path = scenes.trained_path(name)
        field = load_field(path)
        assert isinstance(field, VoxelField), "bundled worlds have voxel fields"
        floor = position_floor(Arena(scenes.load(name), field))
        save_field(replace(field, info=replace(field.info, position_floor_m=floor)), path)
        sys.stdout.write(f"{name}: {1e3 * floor:.2f} mm\n")


if __name__ == "__main__":
    for_named(main)
