"""What `nerfnav train` learns from. Each kind of source is a file with `takes(source)` and `gather(request)`."""

import importlib
from pathlib import Path

import scenes
from app.jobs.training_data.record import Gathering, StoppedError, TrainingData
from app.jobs.training_data.request import Photographs, TrainRequest
from nerfnav.errors import InvalidInputError

KINDS = ("bundled", "meshes", "captures")
"""The files, in the order in which they are asked; each is imported only when its turn comes."""

__all__ = ["Gathering", "Photographs", "StoppedError", "TrainRequest", "TrainingData", "gather"]


def gather(request: TrainRequest) -> Gathering:
    """The material of the first kind that takes the source.

    Raises UnknownNameError or InvalidInputError where no kind does.
    """
    for name in KINDS:
        kind = importlib.import_module(f"app.jobs.training_data.{name}")
        if kind.takes(request.source):
            return kind.gather(request)
    if Path(request.source).exists():
        raise InvalidInputError(
            f"{request.source} is nothing that a field can be trained from: give a bundled scene "
            f"({', '.join(scenes.names())}), a mesh file, or a capture (a folder, transforms.json or .zip)"
        )
    if Path(request.source).suffix or len(Path(request.source).parts) > 1:
        raise InvalidInputError(f"there is no file or folder {request.source}")
    scenes.load(request.source)
    raise AssertionError("a scene that is not among the names cannot be loaded")
