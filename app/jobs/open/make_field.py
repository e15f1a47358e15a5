"""Make a field of a user's file, to open it: by baking (mesh), a draft (capture, video) or import (splats, NeRF).

The field lies beside its source, and is found again there until the source changes. The modules that make fields are
imported where they are needed: a mesh is shown before.
"""

from dataclasses import replace
from pathlib import Path

from nerfnav.core.errors import NerfnavError
from nerfnav.field import TrainConfig, load_field
from nerfnav.importers import Corners, Placement, SceneConfig, SourceKind, field_name, source_kind
from nerfnav.importers.core.kinds import ARCHIVES, folder_of_source
from nerfnav.importers.meshes.files import list_archived_meshes
from nerfnav_app.jobs.events import JobEvents, JobResult, SurfaceShaped
from nerfnav_app.jobs.export.surface import encode_scene
from nerfnav_app.jobs.field.meshes import find_solids, read_visible
from nerfnav_app.jobs.field.request import TrainRequest
from nerfnav_app.places.sources import BUDGETS_S, PICTURE_EVERY_S, USUAL, QualityName
from nerfnav_app.storage.output_files import prepare_file


def run(source: Path, out: Path, quality: QualityName = USUAL, box: Corners | None = None) -> JobEvents:
    """Yield what making it yields, and leave the field in `out`: a mesh is shown meanwhile, a NeRF becomes quick."""
    placement = Placement(box=box)
    kind = source_kind(source)
    if kind.command == "import":
        from nerfnav_app.jobs.open import import_field

        return import_field.run(import_field.ImportRequest(source, out, placement=placement))
    config = TrainConfig(picture_every=PICTURE_EVERY_S)
    request = TrainRequest(str(source), out, quality=quality, placement=placement, config=config)
    if kind is SourceKind.MESH:
        return _bake_mesh(request)
    from nerfnav_app.jobs.field import drafts, train

    if quality == "draft":
        return train.run(replace(request, budget=BUDGETS_S[quality]))
    return drafts.draft(request)


def _bake_mesh(request: TrainRequest) -> JobEvents:
    """Yield the mesh as it is to be seen, then progress, and store its field, to plan in at once and refine later."""
    visible = yield from read_visible(request, SceneConfig.nodes)
    yield SurfaceShaped(encode_scene(visible.scene), rough=True)
    from nerfnav_app.jobs.field import baked
    from nerfnav_app.jobs.field.report import stored

    imported = yield from find_solids(visible)
    field = yield from baked.bake(imported, request.quality, request.seed)
    _, files = stored(field, imported.scene, prepare_file(request.out))
    return JobResult({"source": imported.report}, files)


def find_made_field(source: Path) -> Path | None:
    """Find the field beside a source that was made of it since it last changed; None where there is none."""
    path = _beside(source)
    try:
        if not path.is_file() or path.stat().st_mtime < source.stat().st_mtime:
            return None
        origin = load_field(path).info.source
    except (NerfnavError, OSError):
        return None
    return path if origin in _names_of(source) else None


def choose_field_path(source: Path) -> Path:
    """Choose a path for the field of a source: beside it, under a name that no other file has."""
    path = _beside(source)
    names = (path.with_name(f"{path.stem}-{count}{path.suffix}") for count in range(2, 1000))
    return path if not path.exists() else next(name for name in names if not name.exists())


def _names_of(source: Path) -> set[str]:
    """Names that a field of this source may give as its source: the file, or a mesh or checkpoint in it."""
    inside: set[str] = set()
    if source.is_dir():
        inside = {path.name for path in (*source.glob("*"), *source.glob("meshes/*"))}
    elif source.suffix.lower() in ARCHIVES:
        inside = {Path(name).name for name in list_archived_meshes(source)}
    return {source.name, f"capture {source.name}", *inside}


def _beside(source: Path) -> Path:
    folder = folder_of_source(source)
    return (source.parent if folder is None else folder.resolve().parent) / field_name(source)
