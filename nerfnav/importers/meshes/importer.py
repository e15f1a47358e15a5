"""From a mesh file to a scene that can be photographed, flown in and judged by."""

from collections.abc import Generator
from dataclasses import dataclass
from pathlib import Path

from nerfnav.importers.meshes.config import SceneConfig
from nerfnav.importers.meshes.files import read_mesh
from nerfnav.importers.meshes.parts import parts_of
from nerfnav.importers.meshes.placement import place
from nerfnav.importers.meshes.report import report_of
from nerfnav.importers.meshes.scene import scene_of
from nerfnav.importers.meshes.solids import pieces_of
from nerfnav.world import Scene


@dataclass(frozen=True, eq=False)
class ImportStep:
    """What is being done, and the scene in the end."""

    doing: str
    """For the user to read."""
    fraction: float
    """0 to 1."""
    imported: "Imported | None" = None
    """What became of the file; set on the last step."""


@dataclass(frozen=True, eq=False)
class Imported:
    """A mesh as a place."""

    scene: Scene
    """The place, without tasks."""
    report: dict[str, object]
    """What it was made of and what was guessed."""


def import_mesh(path: Path, config: SceneConfig | None = None) -> Generator[ImportStep, None, None]:
    """Read a mesh file and make a scene of it; the last step carries it.

    Raises MeshFileError, in one sentence, for files that no scene can be made of.
    """
    config = config or SceneConfig()
    yield ImportStep("reading the mesh", 0.0)
    file = read_mesh(path)
    yield ImportStep("joining its parts", 0.3)
    placed = place(parts_of(file), file.declared, config.placement, config.options.units, path)
    yield ImportStep("finding what is solid", 0.5)
    pieces = pieces_of(placed.parts)
    yield ImportStep("looking around", 0.8)
    scene = scene_of(file, placed, pieces, config)
    yield ImportStep("looking around", 1.0, Imported(scene, report_of(file, placed, pieces, scene, config)))
