"""Training data from a mesh: it becomes a scene, is photographed from where it is free, and is its own ground truth."""

import os
import tempfile
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path, PurePosixPath

import torch

from nerfnav.core.errors import InvalidInputError, NerfnavError
from nerfnav.field import TrainConfig
from nerfnav.importers import ImportedMesh, SceneConfig, VisibleMesh, read_visible_mesh
from nerfnav.importers.captures.archive import extract
from nerfnav.importers.meshes.files import SUFFIXES, list_archived_meshes, resolve_mesh, select_mesh
from nerfnav.world import Scene
from nerfnav_app.jobs.events import JobEvent, Progress
from nerfnav_app.jobs.field.bundled import images_for, photograph, training_data_of
from nerfnav_app.jobs.field.request import TrainRequest
from nerfnav_app.jobs.field.training_data import Gathering, relay_import

LEAST_NODES, NODES_PER_SECOND = 3e5, 4e4
"""Nodes of a field for which there is little time: at least, and for each second of it."""
_BESIDE = (".mtl", ".bin", ".png", ".jpg", ".jpeg", ".webp", ".avif", ".gif", ".bmp", ".tga", ".tif", ".tiff")
"""Endings of the files that meshes in an archive may need."""


def gather(request: TrainRequest) -> Gathering:
    """Read the mesh and photograph it. Raises MeshFileError for files that no scene can be made of."""
    imported = yield from read_scene(request, _nodes(request.budget))
    scene = imported.scene
    assert scene.voxel is not None  # an imported scene has one that suits it
    volume = volume_of(scene)
    without_depth = request.depth is False
    count = request.photographs.images or images_for(volume, with_depth=not without_depth)
    capture = replace(request.capture.clear_of(scene.voxel), images=count)
    photographs = yield from photograph(scene, capture, torch.Generator().manual_seed(request.seed))
    report = {**imported.report, "images_used": len(photographs), "images_skipped": 0}
    return training_data_of(scene, photographs.without_depth() if without_depth else photographs, report, volume)


def volume_of(scene: Scene) -> float:
    """Volume that a place of the paper's voxels would have [m^3]: places of all sizes take as much work, in voxels."""
    assert scene.voxel is not None, "an imported scene has one that suits it"
    return scene.box.size.prod().item() * (TrainConfig.voxel / scene.voxel) ** 3


def read_scene(request: TrainRequest, nodes: float) -> Generator[JobEvent, bool | None, ImportedMesh]:
    """Read the mesh and find what is solid. Raises MeshFileError as `read_visible` does."""
    return (yield from find_solids((yield from read_visible(request, nodes))))


def find_solids(visible: VisibleMesh) -> Generator[JobEvent, bool | None, ImportedMesh]:
    """Find what is solid in a mesh, which may be shown before."""
    yield Progress("finding what is solid", 0.7)
    return visible.with_solids()


def read_visible(request: TrainRequest, nodes: float) -> Generator[JobEvent, bool | None, VisibleMesh]:
    """Read what is seen of the mesh, with voxels so that its box has `nodes` of them where the request gives none.

    Raises MeshFileError for files that no scene can be made of.
    """
    request.require_unset("a mesh", downscale=request.photographs.downscale)
    with _unpack_mesh(Path(request.source)) as path:
        config = SceneConfig(request.placement, request.mesh, request.voxel, nodes)
        return (yield from relay_import(read_visible_mesh(path, config), "reading the mesh"))


def _nodes(budget: float | None) -> float:
    """Nodes that can be trained in a time [s]: a grid that no ray has reached yet is worse than a coarse one."""
    return SceneConfig.nodes if budget is None else min(SceneConfig.nodes, max(LEAST_NODES, NODES_PER_SECOND * budget))


@contextmanager
def _unpack_mesh(source: Path) -> Iterator[Path]:
    """Unpack the mesh file of an archive, for as long as it is read; any other mesh is where it is."""
    if source.suffix.lower() != ".zip":
        yield resolve_mesh(source)
        return
    names = list_archived_meshes(source)
    name = select_mesh([PurePosixPath(name) for name in names])
    if name is None:
        raise InvalidInputError(f"{source} holds {len(names)} meshes ({', '.join(names[:5])}): pack one alone")
    with tempfile.TemporaryDirectory(prefix="nerfnav-", ignore_cleanup_errors=True) as folder:
        extract(source, Path(folder), (*SUFFIXES, *_BESIDE))
        try:
            yield Path(folder) / name
        except NerfnavError as error:
            if folder in str(error):  # the user knows the archive, not the folder that it was unpacked into
                words = (word.replace(folder + os.sep, "") if isinstance(word, str) else word for word in error.args)
                error.args = tuple(words)
            raise
