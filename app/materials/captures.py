"""Material from a capture: a folder, a transforms.json, or a .zip of either."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path

from app.events import Progress
from app.materials.material import Gathering, Material, StoppedError
from app.materials.request import TrainRequest
from nerfnav.errors import InvalidInputError
from nerfnav.importers.captures.archive import unpacked
from nerfnav.importers.captures.capture import import_capture
from nerfnav.importers.captures.imported import ImportConfig, ImportedCapture
from nerfnav.importers.captures.views import CaptureError

ITERATIONS = 2000
"""Training steps that photographs ask for where nobody gave a number."""
NODES = 2_000_000
"""Nodes of the field of a capture, where nobody gave the size of a voxel: fifty photographs do not tell more apart, and
finer fields learn their noise (the fox: 22.5 dB with 6 million, 23.2 dB with 2)."""


def takes(source: str) -> bool:
    """Whether a source is a folder, or a file that may be or hold a capture."""
    path = Path(source)
    return path.is_dir() or (path.suffix.lower() in (".json", ".zip") and path.is_file())


def gather(request: TrainRequest) -> Gathering:
    """Read the capture.

    Raises CaptureError where there is none that a field can be trained from, InvalidInputError for options that it
    has no use for.
    """
    request.require_unset(
        "a capture", images=request.photographs.count, units=request.mesh.units, seen_from=request.mesh.seen_from
    )
    with _unzipped(Path(request.source)) as (source, within):
        photographs = request.photographs
        config = ImportConfig(
            request.placement, photographs.downscale, photographs.held_out_every, request.depth is not False, within
        )
        for step in import_capture(source, config):
            stop = yield Progress("reading photographs", step.fraction)
            if step.capture is not None:
                if request.depth and not step.capture.report.images_with_depth:
                    raise InvalidInputError(f"{source} has no depth maps (depth_file_path) to learn with")
                return _material(step.capture)
            if stop:
                raise StoppedError("stopped while reading photographs: nothing was learned yet, so nothing is saved")
    raise AssertionError("an import ends with its capture")


@contextmanager
def _unzipped(source: Path) -> Iterator[tuple[Path, Path | None]]:
    """The capture, and the folder that it may not read beyond: one that came as a file may come from anybody."""
    if source.suffix.lower() != ".zip":
        yield source, None
        return
    with tempfile.TemporaryDirectory(prefix="nerfnav-", ignore_cleanup_errors=True) as folder:
        try:
            yield unpacked(source, Path(folder)), Path(folder)
        except CaptureError as error:
            # people know the archive, not the folder that it was unpacked into
            raise CaptureError(str(error).replace(folder + os.sep, "").replace(folder, str(source))) from error


def _material(capture: ImportedCapture) -> Material:
    report = asdict(capture.report)
    voxel = (capture.box.size.prod().item() / NODES) ** (1 / 3)
    return Material(
        capture.learned,
        capture.held_out,
        capture.box,
        capture.background,
        None,
        {**report, "kind": f"capture ({capture.report.kind})"},
        voxel,
        ITERATIONS,
        capture.bounded,
    )
