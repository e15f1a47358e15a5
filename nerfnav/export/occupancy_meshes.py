"""Closed meshes around the voxels that are solid or unproven, as binary glTF.

glTF is Y-up: the node above them turns the world by -90 degrees about x, so vertices keep the library's numbers."""

from typing import TYPE_CHECKING

import numpy as np
from jaxtyping import Bool

from nerfnav.field import StateGrid, VoxelState
from nerfnav.glb import packed

if TYPE_CHECKING:
    import trimesh


_COLORS = {VoxelState.SOLID: (170, 175, 185, 255), VoxelState.UNPROVEN: (235, 150, 60, 255)}


def mesh_files(grid: StateGrid, stem: str, height: float | None) -> dict[str, bytes]:
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
    content = scene.export(file_type="glb") if scene.geometry else packed(_EMPTY, b"")
    assert isinstance(content, bytes)
    return {f"{stem}.glb": content}


def _surface(grid: StateGrid, chosen: Bool[np.ndarray, "nx ny nz"]) -> "trimesh.Trimesh":
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


_EMPTY = {"asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": []}]}
"""A glTF of nothing: all is free."""
