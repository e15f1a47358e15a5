"""Training data from a capture: a folder, a transforms.json, a .zip or .r3d of either, or a video."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path

from app.jobs.events import Progress
from app.jobs.training_data.record import Gathering, StoppedError, TrainingData
from app.jobs.training_data.request import TrainRequest
from nerfnav.errors import InvalidInputError
from nerfnav.importers.captures.archive import unpacked
from nerfnav.importers.captures.capture import import_capture
from nerfnav.importers.captures.imported import ImportConfig, ImportedCapture
from nerfnav.importers.captures.video import capture_of_video
from nerfnav.importers.captures.views import CaptureError
from nerfnav.importers.suffixes import ARCHIVES, VIDEOS

ITERATIONS = 2000
"""Training steps that photographs ask for where nobody gave a number."""
NODES = 2_000_000
"""Nodes of the field of a capture, where nobody gave the size of a voxel: fifty photographs do not tell more apart, and
finer fields learn their noise (the fox: 22.5 dB with 6 million, 23.2 dB with 2)."""


def gather(request: TrainRequest) -> Gathering:
    """Read the capture.

    Raises CaptureError where there is none that a field can be trained from, InvalidInputError for options that it
    has no use for.
    """
    request.require_unset(
        "a capture", images=request.photographs.count, units=request.mesh.units, seen_from=request.mesh.seen_from
    )
    with _unzipped(Path(request.source)) as (source, within):
        if (video := Path(request.source)).suffix.lower() in VIDEOS:
            for posing in capture_of_video(video, source):
                if (yield Progress(posing.doing, posing.fraction)):
                    raise StoppedError("stopped while posing the video: nothing was learned yet, so nothing is saved")
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
    suffix = source.suffix.lower()
    if suffix not in (*ARCHIVES, *VIDEOS):
        yield source, None
        return
    with tempfile.TemporaryDirectory(prefix="nerfnav-", ignore_cleanup_errors=True) as folder:
        try:
            yield unpacked(source, Path(folder)) if suffix in ARCHIVES else Path(folder), Path(folder)
        except CaptureError as error:
            # people know the archive, not the folder that it was unpacked into
            raise CaptureError(str(error).replace(folder + os.sep, "").replace(folder, str(source))) from error


def _material(capture: ImportedCapture) -> TrainingData:
    report = asdict(capture.report)
    voxel = (capture.box.size.prod().item() / NODES) ** (1 / 3)
    return TrainingData(
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
