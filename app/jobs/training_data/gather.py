"""What `nerfnav train` learns from. Each kind of source is a file with `gather(request)`."""

import importlib
from pathlib import Path

import nerfnav_scenes as scenes
from nerfnav.errors import InvalidInputError
from nerfnav.importers import SourceKind, source_kind, wrong_kind
from nerfnav_app.jobs.training_data.record import Gathering, StoppedError, TrainingData
from nerfnav_app.jobs.training_data.request import Photographs, TrainRequest

KINDS = {
    SourceKind.SCENE: "bundled",
    SourceKind.MESH: "meshes",
    SourceKind.CAPTURE: "captures",
    SourceKind.VIDEO: "captures",
}
"""The file for each kind; it is imported only when it is needed."""

__all__ = ["Gathering", "Photographs", "StoppedError", "TrainRequest", "TrainingData", "gather"]


def gather(request: TrainRequest) -> Gathering:
    """The material of a source.

    Raises UnknownNameError, InvalidInputError or WrongKindError where no field can be trained from it.
    """
    kind = source_kind(request.source, scenes.names())
    if kind in KINDS:
        return importlib.import_module(f"nerfnav_app.jobs.training_data.{KINDS[kind]}").gather(request)
    if kind is not SourceKind.MISSING:
        raise wrong_kind(request.source, kind, "a scene, a mesh, a capture or a video")
    if Path(request.source).suffix or len(Path(request.source).parts) > 1:
        raise InvalidInputError(f"there is no file or folder {request.source}")
    scenes.load(request.source)
    raise AssertionError("a scene that is not among the names cannot be loaded")
