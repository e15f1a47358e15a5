"""What planners believe of a place, as files that other programs read: voxels, a collision mesh, a map of ROS.

`.npz`: `state` (uint8, nx x ny x nz: 0 free, 1 solid, 2 unproven), `lower` (3) and `voxel` [m]; voxel (i, j, k) reaches
from lower + voxel (i, j, k) to lower + voxel (i + 1, j + 1, k + 1).

`.glb`: closed meshes `solid` and `unproven` around the voxels of these states; planners keep off both. glTF is Y-up:
the node above them turns the world by -90 degrees about x, so vertices keep the library's numbers.

`.pgm` with `.yaml`: one layer, as ROS's map_server has it: free 254, occupied 0, unknown 205; the first row is the
northernmost, and `origin` is the lower left corner.
"""

import io
import json
from collections.abc import Callable

import numpy as np

from nerfnav.core.errors import InvalidInputError, UnknownNameError
from nerfnav.export.occupancy_meshes import mesh_files
from nerfnav.field import StateGrid, VoxelState

_OCCUPIED_FROM, _FREE_BELOW = 0.65, 0.196
"""map_server's thresholds: unknown, (255 - 205) / 255 = 0.19608, lies between them, if barely."""
_SHADES = {VoxelState.FREE: 254, VoxelState.SOLID: 0, VoxelState.UNPROVEN: 205}


def map_files(grid: StateGrid, ending: str, stem: str, height: float | None = None) -> dict[str, bytes]:
    """The files, by their names, that a map called `stem` with an ending of `ENDINGS` consists of.

    `height` [m] says which layer a map of ROS shows (default: the middle one). Raises UnknownNameError, which lists the
    endings, and InvalidInputError for a height that is not in the map or that the ending has no use for.
    """
    check_ending(ending, height)
    return ENDINGS[ending](grid, stem, height)


def check_ending(ending: str, height: float | None = None) -> None:
    """Raise what `map_files` would, as far as that can be told without a map."""
    if ending not in ENDINGS:
        raise UnknownNameError("kind of map with the ending", ending, ENDINGS)
    if height is not None and ending not in _FLAT:
        raise InvalidInputError(f"a {ending} map has all heights: a height is for {' and '.join(_FLAT)} alone")


def _voxels(grid: StateGrid, stem: str, height: float | None) -> dict[str, bytes]:
    stream = io.BytesIO()
    np.savez_compressed(stream, state=grid.state, lower=grid.lower, voxel=np.float64(grid.voxel))
    return {f"{stem}.npz": stream.getvalue()}


def _ros(grid: StateGrid, stem: str, height: float | None) -> dict[str, bytes]:
    middle = float(grid.lower[2] + 0.5 * grid.voxel * grid.state.shape[2])
    layer = grid.layer(middle if height is None else height)
    shades = np.zeros(len(VoxelState), np.uint8)
    for state, shade in _SHADES.items():
        shades[state] = shade
    rows = np.ascontiguousarray(shades[layer].T[::-1])  # x to the right, y upwards
    picture = f"P5\n{rows.shape[1]} {rows.shape[0]}\n255\n".encode() + rows.tobytes()
    x, y, _ = grid.lower.tolist()
    lines = [
        f"image: {json.dumps(stem + '.pgm')}",  # a string of YAML too, whatever the name
        "mode: trinary",
        f"resolution: {grid.voxel!r}",
        f"origin: [{x!r}, {y!r}, 0.0]",
        "negate: 0",
        f"occupied_thresh: {_OCCUPIED_FROM}",
        f"free_thresh: {_FREE_BELOW}",
    ]
    return {f"{stem}.pgm": picture, f"{stem}.yaml": "\n".join([*lines, ""]).encode()}


ENDINGS: dict[str, Callable[[StateGrid, str, float | None], dict[str, bytes]]] = {
    ".npz": _voxels,
    ".glb": mesh_files,
    ".pgm": _ros,
    ".yaml": _ros,
}
"""Ending of a file to what makes it and what belongs to it."""
_FLAT = (".pgm", ".yaml")
"""Endings of maps of one height."""
