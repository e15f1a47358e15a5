"""Training data: photographs, a box, and what is known about them, gathered from a source of any kind.

Each kind of source is a file with `gather(request)`, imported only when it is needed (KINDS).
"""

import importlib
from collections.abc import Generator
from contextlib import closing
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

from jaxtyping import Float
from torch import Tensor

import nerfnav_scenes as scenes
from nerfnav.core.errors import InvalidInputError, NerfnavError, naming_input
from nerfnav.formats import KeyReport
from nerfnav.geometry import Box, PosedImages
from nerfnav.importers import SourceKind, source_kind, wrong_kind_error
from nerfnav.importers.core.progress import ImportStep
from nerfnav.world import Scene
from nerfnav_app.jobs.events import JobEvent, Progress, SurfaceShaped
from nerfnav_app.jobs.field.request import TrainRequest

Imported = TypeVar("Imported")


class StoppedError(NerfnavError):
    """A job that was stopped before there was anything to keep."""


@dataclass(frozen=True, eq=False)
class TrainingData:
    """Photographs of a source with all that training needs."""

    learned: PosedImages
    """Photographs that the field learns from."""
    held_out: PosedImages
    """Photographs that judge it: it never sees them."""
    box: Box
    """Box of the field."""
    background: Float[Tensor, "3"]
    """sRGB colour of rays that nothing stops, in [0, 1]."""
    truth: Scene | None
    """The ground truth, where there is one."""
    report: dict[str, object]
    """Numbers of the source for `nerfnav train --json`: its kind, what was used, what was guessed."""
    voxel: float | None = None
    """Distance of nodes that suits it [m]; None: TrainConfig's."""
    iterations: int | None = None
    """Training steps that it asks for; None: TrainConfig's."""
    bounded: bool = True
    """All that the photographs show, except the background's colour, lies in the box."""

    camera: tuple[float, ...] = ()
    """Camera of the photographs, as `Camera.numbers`; empty where it is not worth noting."""
    placed: tuple[float, ...] = ()
    """Similarity from capture to field, as `Similarity.numbers`; empty where there is none."""
    input_keys: KeyReport | None = None
    """Keys of the capture's files by their treatment; None where there is no capture."""

    @property
    def guesses(self) -> tuple[str, ...]:
        """Guesses about the source, as sentences."""
        guesses = self.report.get("guesses", ())
        return tuple(map(str, guesses)) if isinstance(guesses, list | tuple) else ()


def relay_import(
    steps: Generator[ImportStep, None, Imported], doing: str
) -> Generator[JobEvent, bool | None, Imported]:
    """Yield the steps of an import as progress, and cameras and points as soon as they are known; return its result.

    Raises StoppedError where it is stopped.
    """
    with closing(steps):  # a process of theirs ends with them
        while True:
            try:
                step = next(steps)
            except StopIteration as end:
                return end.value
            stop = None
            if step.model is not None:
                from nerfnav_app.places.sparse_model import encode_sparse_model  # slow to import

                stop = yield SurfaceShaped(encode_sparse_model(step.model), rough=True)
            if (yield Progress(step.doing, step.fraction)) or stop:
                raise StoppedError(f"stopped while {doing}: nothing was learned yet, so nothing is saved")


Gathering = Generator[JobEvent, bool | None, TrainingData]
"""Training data in the making: yields progress, and returns it. Send True to stop early."""


KINDS = {
    SourceKind.SCENE: "bundled",
    SourceKind.MESH: "meshes",
    SourceKind.CAPTURE: "captures",
    SourceKind.VIDEO: "captures",
}
"""The file for each kind; it is imported only when it is needed."""


def gather(request: TrainRequest) -> Gathering:
    """The material of a source.

    Raises UnknownNameError, InvalidInputError, which names the source, or WrongKindError where no field can be trained
    from it.
    """
    kind = source_kind(request.source, scenes.names())
    if kind in KINDS:
        with naming_input(request.source):
            return (yield from importlib.import_module(f"nerfnav_app.jobs.field.{KINDS[kind]}").gather(request))
    if kind is not SourceKind.MISSING:
        raise wrong_kind_error(request.source, kind, "a scene, a mesh, a capture or a video")
    if Path(request.source).suffix or len(Path(request.source).parts) > 1:
        raise InvalidInputError(f"there is no file or folder {request.source}")
    scenes.load(request.source)
    raise AssertionError("a scene that is not among the names cannot be loaded")
