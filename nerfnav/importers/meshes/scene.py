"""Scene of a mesh that lies as it should."""

import numpy as np
import torch
import trimesh

from nerfnav.geometry import Box
from nerfnav.importers.meshes.config import SceneConfig
from nerfnav.importers.meshes.field_box import box_and_voxel
from nerfnav.importers.meshes.files import MeshFile
from nerfnav.importers.meshes.light import lit
from nerfnav.importers.meshes.placement import Placed
from nerfnav.importers.meshes.solids import Pieces
from nerfnav.world import Scene, Vantage, guess_vantage

_SKY = (0.72, 0.83, 0.95)


def scene_of(file: MeshFile, placed: Placed, pieces: Pieces, config: SceneConfig) -> Scene:
    parts = placed.parts
    mesh = trimesh.Trimesh(parts.vertices, parts.faces, process=False)
    bounds = Box(*torch.from_numpy(parts.bounds).float())
    told = config.options.seen_from
    vantage = guess_vantage(mesh, bounds) if told is None else Vantage(told)
    box, voxel = box_and_voxel(bounds, vantage, config)
    return Scene(
        # with its ending, so that it is never taken for a bundled scene
        file.path.name,
        file.path.name,
        mesh,
        pieces.solids,
        box,
        _SKY,
        (),
        voxel,
        lit(parts, np.asarray(mesh.face_normals)),
        pieces.sheets,
        vantage,
    )
