"""Open a place by the name of its scene or the path of its field."""

import os
from pathlib import Path

import scenes
from app.places.place import Place, Truth
from nerfnav import robots
from nerfnav.errors import NerfnavError, UnknownNameError
from nerfnav.field import StoredField, load_field
from nerfnav.importers import SourceKind, load_splats, source_kind, splats_beside, wrong_kind
from nerfnav.importers.suffixes import FIELD


class NoTrainedFieldError(NerfnavError):
    """A scene whose field has not been trained yet."""


def open_place(what: str, robot: str = "quadrotor") -> Place:
    """Open a bundled scene by name, or a field file by path.

    A field that was trained from a bundled scene finds that scene again as its ground truth, one that was trained from
    a mesh finds that beside its file; without it, nothing is judged there.
    Raises UnknownNameError, NoTrainedFieldError or FieldFileError.
    """
    path = field_file(what)
    body, field = robots.load(robot), load_field(path)
    if what in scenes.names():
        return Place(what, field, _truth_of(what), body, file=path)
    beside = splats_beside(path)
    splats = load_splats(beside) if beside.is_file() else None
    return Place(path.stem, field, ground_truth(field, path), body, splats, path)


def ground_truth(field: StoredField, path: Path) -> Truth | None:
    """What the field in the file `path` was trained from; None where that is unknown, or no longer beside the file.

    Raises FieldFileError where what lies there is something else.
    """
    if field.info.truth:
        from nerfnav.importers.meshes.truth import load_truth  # slow to import

        beside = path.with_name(Path(field.info.truth).name)
        if not beside.is_file():
            return None
        scene = load_truth(beside, field.info.truth_sha256)
        return Truth(scene.tasks, lambda: scene)
    return _truth_of(field.info.source) if field.info.source in scenes.names() else None


def _truth_of(name: str) -> Truth:
    """The ground truth of a bundled scene."""
    return Truth(scenes.tasks_of(name), lambda: scenes.load(name))


def field_file(what: str) -> Path:
    """The file of the field that a user means by a scene's name or a path.

    Raises UnknownNameError where it is neither, NoTrainedFieldError where the scene comes without a field,
    WrongKindError, which says what makes a field of it, for anything else.
    """
    if what in scenes.names():
        path = scenes.trained_path(what)
        if not path.is_file():
            raise NoTrainedFieldError(
                f"the scene {what!r} has no trained field yet: run `nerfnav train {what} --out {what}.npz`, "
                f"then open {what}.npz"
            )
        return path
    if not _is_path(what):
        raise UnknownNameError("scene or field file", what, scenes.names())
    kind = source_kind(what)
    missing = kind is SourceKind.MISSING and Path(what).suffix in (FIELD, "")  # reading tells how to make it
    if kind is not SourceKind.FIELD and not missing:
        raise wrong_kind(what, kind, "a field")
    return Path(what)


def _is_path(what: str) -> bool:
    """Whether the user means a file: it exists, or is written like one."""
    return Path(what).exists() or os.sep in what or bool(Path(what).suffix)
