"""Mesh importer: read a mesh file and make a scene to photograph, fly in and judge by.

The scene has a box and a voxel size for its field, light on plain parts, so that their edges are seen, and a report
of its content and the guesses.
"""

import math
from collections.abc import Generator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import torch
import trimesh
from jaxtyping import Float

from nerfnav.geometry import Box
from nerfnav.importers.core.progress import ImportStep
from nerfnav.importers.meshes.config import SceneConfig
from nerfnav.importers.meshes.files import MeshFile, read_mesh
from nerfnav.importers.meshes.parts import Parts, join_parts
from nerfnav.importers.meshes.placement import PlacedMesh, place_mesh
from nerfnav.importers.meshes.solids import Pieces, split_solids
from nerfnav.importers.meshes.stray import find_stray, leave_out_stray
from nerfnav.world import Paint, Scene, Vantage, guess_vantage


def box_and_voxel(bounds: Box, vantage: Vantage, config: SceneConfig) -> tuple[Box, float]:
    """Box of the field, and size of its voxels [m]."""
    if config.placement.box is not None:
        box = Box.of(*config.placement.box)
        return box, config.voxel or _voxel(box, config.nodes)
    aside = config.aside * float(bounds.size.max())
    above = max(config.headroom * float(bounds.size[2]), aside)
    if vantage is Vantage.INSIDE:
        aside = above = 0.0
    box = Box(
        bounds.lower - torch.tensor([aside, aside, 0.0]), bounds.upper + torch.tensor([aside, aside, above])
    )
    voxel = config.voxel or _voxel(box, config.nodes)
    border = config.below * voxel
    around = border if vantage is Vantage.INSIDE else 0.0
    return Box(box.lower - torch.tensor([around, around, border]), box.upper + around), voxel


def _voxel(box: Box, nodes: float) -> float:
    """The size at which a box has so many nodes, rounded to two digits [m]."""
    exact = float((box.size.double().prod() / nodes) ** (1 / 3))
    return round(exact, 1 - math.floor(math.log10(exact)))


_LIGHT = np.array([0.37, 0.53, 0.76])
"""Direction of the light on plain parts: along no axis, so that the walls of a room differ."""
_SHADE = 0.45
"""Darkening of a plain face at right angles to the light, relative to full light."""


def shade_paint(parts: Parts, normals: Float[np.ndarray, "f 3"]) -> Paint:
    """The paint, with light on plain parts. It falls on both sides of a face: files often get wrong which is seen."""
    light = 1 - _SHADE * (1 - np.abs(normals @ (_LIGHT / np.linalg.norm(_LIGHT))))
    light = np.where(parts.plain, light, 1.0)[:, None, None]
    return replace(parts.paint, tint=(parts.paint.tint * light).round().astype(np.uint8))


_SKY = (0.72, 0.83, 0.95)


def scene_of(file: MeshFile, placed: PlacedMesh, config: SceneConfig) -> Scene:
    """The place as it is seen, without solids."""
    parts = placed.parts
    mesh = trimesh.Trimesh(parts.vertices, parts.faces, process=False)
    bounds = Box(*torch.from_numpy(parts.bounds).float())
    given = config.options.seen_from
    vantage = guess_vantage(mesh, bounds) if given is None else Vantage(given)
    box, voxel = box_and_voxel(bounds, vantage, config)
    return Scene(
        # with its ending, so that it is never taken for a bundled scene
        file.path.name,
        file.path.name,
        mesh,
        (),
        box,
        _SKY,
        (),
        voxel,
        shade_paint(parts, np.asarray(mesh.face_normals)),
        vantage=vantage,
    )


_COARSE = 0.03
"""Voxels larger than this [m] blur what the paper's robot, 10 cm wide, has to avoid."""


def report_of(
    file: MeshFile, placed: PlacedMesh, pieces: Pieces, scene: Scene, config: SceneConfig
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


@dataclass(frozen=True, eq=False)
class ImportedMesh:
    """A mesh as a place."""

    scene: Scene
    """The place, without tasks."""
    report: dict[str, object]
    """Content of the file and guesses."""


@dataclass(frozen=True, eq=False)
class VisibleMesh:
    """A mesh that can be shown, before what is solid in it is found."""

    scene: Scene
    """The place, without tasks and solids."""
    file: MeshFile
    """The file as it was read."""
    placed: PlacedMesh
    """Its parts in the world."""
    config: SceneConfig
    """Options of the import."""

    def with_solids(self) -> ImportedMesh:
        """Find what is solid, which takes as long as to read the mesh."""
        pieces = split_solids(self.placed.parts)
        scene = replace(self.scene, solids=pieces.solids, sheets=pieces.sheets)
        return ImportedMesh(scene, report_of(self.file, self.placed, pieces, scene, self.config))


def import_mesh(path: Path, config: SceneConfig | None = None) -> Generator[ImportStep, None, ImportedMesh]:
    """Read a mesh file and return its scene. Raises MeshFileError as `read_visible_mesh` does."""
    visible = yield from read_visible_mesh(path, config)
    yield ImportStep("finding what is solid", 0.7)
    return visible.with_solids()


def read_visible_mesh(path: Path, config: SceneConfig | None = None) -> Generator[ImportStep, None, VisibleMesh]:
    """Read a mesh file and return what is seen of it.

    Raises MeshFileError, in one sentence, for unusable files, and StrayPartsError for parts far away without a box.
    """
    config = config or SceneConfig()
    yield ImportStep("reading the mesh", 0.0)
    file = read_mesh(path)
    yield ImportStep("joining its parts", 0.3)
    parts = join_parts(file.parts, path)
    stray = find_stray(parts)
    placed = place_mesh(parts, file.declared, config.placement, config.options.units, path, stray)
    if stray.any():
        kept, note = leave_out_stray(placed.parts, stray, config.placement.box, path)
        placed = replace(placed, parts=kept, guesses=(*placed.guesses, note))
    yield ImportStep("looking around", 0.5)
    return VisibleMesh(scene_of(file, placed, config), file, placed, config)
