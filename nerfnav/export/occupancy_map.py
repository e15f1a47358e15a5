"""Occupancy map: the space as planners know it, as voxels, as a collision mesh, or as a map of ROS.

`.npz`: `state` (uint8, nx x ny x nz: 0 free, 1 solid, 2 unproven), `lower` (3) and `voxel` [m]; voxel (i, j, k)
reaches from lower + voxel (i, j, k) to lower + voxel (i + 1, j + 1, k + 1).

`.glb`: closed meshes `solid` and `unproven` around the voxels of these states; planners keep off both. glTF is Y-up:
the node above them turns the world by -90 degrees about x, so vertices keep the library's numbers.

`.pgm` with `.yaml`: one layer, as ROS's map_server has it: free 254, occupied 0, unknown 205; the first row is the
northernmost, and `origin` is the lower left corner.
"""

import io
import json
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool

from nerfnav.core.errors import InvalidInputError, UnknownNameError
from nerfnav.core.glb import packed
from nerfnav.field import Occupancy, OccupancyGrid

if TYPE_CHECKING:
    import trimesh


_COLORS = {Occupancy.SOLID: (170, 175, 185, 255), Occupancy.UNPROVEN: (235, 150, 60, 255)}


def mesh_files(grid: OccupancyGrid, stem: str, height: float | None) -> dict[str, bytes]:
    import trimesh  # slow to import
    from trimesh.visual import TextureVisuals
    from trimesh.visual.material import PBRMaterial

    scene, root = trimesh.Scene(), "world_z_up"
    upright = trimesh.transformations.rotation_matrix(-np.pi / 2, (1, 0, 0))
    scene.graph.update(root, scene.graph.base_frame, matrix=upright)
    for state, color in _COLORS.items():
        mesh, name = _surface(grid, grid.state == state), state.name.lower()
        if len(mesh.faces):
            paint = PBRMaterial(name=name, baseColorFactor=color, roughnessFactor=1.0)
            mesh.visual = TextureVisuals(material=paint)
            scene.add_geometry(mesh, name, name, root)
    empty = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}]}  # all is free
    content = scene.export(file_type="glb") if scene.geometry else packed(empty, b"")
    assert isinstance(content, bytes)
    return {f"{stem}.glb": content}


def _surface(grid: OccupancyGrid, chosen: Bool[np.ndarray, "nx ny nz"]) -> "trimesh.Trimesh":
    """The closed surface halfway between the middles of chosen voxels and those of the others, which is their faces.

    Marching cubes (Lorensen and Cline, 1987): edges and corners are cut at half a voxel. Empty where none is chosen.
    """
    import trimesh
    from skimage.measure import marching_cubes

    if not chosen.any():
        return trimesh.Trimesh()
    vertices, faces, *_ = marching_cubes(np.pad(chosen, 1).astype(np.float32), 0.5, gradient_direction="ascent")
    # index (0, 0, 0) is the middle of the padding's first voxel
    return trimesh.Trimesh(grid.lower + grid.voxel * (vertices - 0.5), faces, process=False)


_OCCUPIED_FROM, _FREE_BELOW = 0.65, 0.196
"""map_server's thresholds: unknown, (255 - 205) / 255 = 0.19608, lies between them, if barely."""
_SHADES = {Occupancy.FREE: 254, Occupancy.SOLID: 0, Occupancy.UNPROVEN: 205}


def map_files(grid: OccupancyGrid, ending: str, stem: str, height: float | None = None) -> dict[str, bytes]:
    """Make the files of a map called `stem` with an ending of `ENDINGS`, by name.

    `height` [m] selects the layer of a map of ROS (default: the middle one). Raises UnknownNameError, which lists the
    endings, and InvalidInputError for a height that is not in the map or that the ending has no use for.
    """
    check_ending(ending, height)
    return ENDINGS[ending](grid, stem, height)


def check_ending(ending: str, height: float | None = None) -> None:
    """Raise the errors of `map_files` that need no map."""
    if ending not in ENDINGS:
        raise UnknownNameError("kind of map with the ending", ending, ENDINGS)
    if height is not None and ending not in _FLAT:
        raise InvalidInputError(f"a {ending} map has all heights: a height is for {' and '.join(_FLAT)} alone")


def _voxels(grid: OccupancyGrid, stem: str, height: float | None) -> dict[str, bytes]:
    stream = io.BytesIO()
    np.savez_compressed(stream, state=grid.state, lower=grid.lower, voxel=np.float64(grid.voxel))
    return {f"{stem}.npz": stream.getvalue()}


def _ros(grid: OccupancyGrid, stem: str, height: float | None) -> dict[str, bytes]:
    middle = float(grid.lower[2] + 0.5 * grid.voxel * grid.state.shape[2])
    layer = grid.layer(middle if height is None else height)
    shades = np.array([_SHADES[state] for state in Occupancy], np.uint8)
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


ENDINGS: dict[str, Callable[[OccupancyGrid, str, float | None], dict[str, bytes]]] = {
    ".npz": _voxels,
    ".glb": mesh_files,
    ".pgm": _ros,
    ".yaml": _ros,
}
"""Ending of a file to what makes it and what belongs to it."""
_FLAT = (".pgm", ".yaml")
"""Endings of maps of one height."""
