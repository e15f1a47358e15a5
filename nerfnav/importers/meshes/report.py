"""Report of what a place was made of, and what was guessed."""

import numpy as np

from nerfnav.importers.meshes.config import SceneConfig
from nerfnav.importers.meshes.files import MeshFile
from nerfnav.importers.meshes.placement import Placed
from nerfnav.importers.meshes.solids import Pieces
from nerfnav.world import Scene, Vantage

_COARSE = 0.03
"""Voxels larger than this [m] blur what the paper's robot, 10 cm wide, has to avoid."""


def report_of(
    file: MeshFile, placed: Placed, pieces: Pieces, scene: Scene, config: SceneConfig
) -> dict[str, object]:
    guesses = list(placed.guesses)
    if config.options.seen_from is None:
        seen = "a room, seen from inside" if scene.vantage is Vantage.INSIDE else "open ground, seen from all around"
        guesses.append(f"it is {seen} (guessed from how much of it lies around its middle)")
    if config.voxel is None and scene.voxel is not None:
        coarse = ", coarse for robots of 10 cm" if scene.voxel > _COARSE else ""
        guesses.append(
            f"voxels are {100 * scene.voxel:.2g} cm{coarse} (--voxel and --box make them finer, --scale it smaller)"
        )
    return {
        "kind": "mesh",
        "format": file.path.suffix[1:].lower(),
        "up": placed.up,
        "scale": placed.scale,
        "size_m": [round(float(x), 4) for x in np.ptp(placed.parts.bounds, axis=0)],
        "seen_from": scene.vantage.value,
        "voxel_m": scene.voxel,
        "faces": len(placed.parts.faces),
        "textures": len(placed.parts.paint.images),
        "solids": len(pieces.solids),
        "solids_not_watertight": pieces.open_solids,
        "surfaces_without_inside": int(sum(len(sheet.faces) for sheet in pieces.sheets)),
        "guesses": guesses + list(file.notes),
    }
