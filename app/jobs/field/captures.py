"""Training data from a capture: a folder, a transforms.json, a .zip or .r3d of either, or a video."""

import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict
from pathlib import Path

from nerfnav.core.errors import InvalidInputError
from nerfnav.importers import CaptureError, ImportConfig, ImportedCapture, import_capture, make_capture_of_video
from nerfnav.importers.captures.archive import unpack_capture
from nerfnav.importers.captures.video import VideoConfig, VideoReport
from nerfnav.importers.core.kinds import ARCHIVES, VIDEOS
from nerfnav_app.jobs.field.request import TrainRequest
from nerfnav_app.jobs.field.training_data import Gathering, TrainingData, relay_import
from nerfnav_app.places.sources import QualityName

ITERATIONS = 2000
"""Training steps that photographs ask for by default."""
NODES = 2_000_000
"""Nodes of the field of a capture, by default: fifty photographs do not tell more apart, and
finer fields learn their noise (the fox: 22.5 dB with 6 million, 23.2 dB with 2)."""

CUT_OUT_ITERATIONS = 6000
"""The same where pictures are cut out: steps of few rays."""
CUT_OUT_NODES = 6_000_000
"""Nodes of the field of pictures that are cut out: most of them are empty."""
FRAMES: dict[QualityName, int] = {"draft": 40, "good": 80, "best": 150}
"""Frames of a video, at most."""
FRAMES_PER_SECOND = 4 / 3
"""The same for each second of a budget, where that is less: on two cores, posing them takes about half of it.

The page's budgets change nothing, so that a field that is trained again there has the same frames, and the same world.
"""
CUT_OUT_NODES_PER_SECOND = 60_000
"""Nodes for each second of a budget, at most: a grid that no ray has reached yet is worse than a coarse one."""


def gather(request: TrainRequest) -> Gathering:
    """Read the capture.

    Raises CaptureError where there is none that a field can be trained from, InvalidInputError for options that it
    has no use for.
    """
    request.require_unset(
        "a capture", images=request.photographs.images, units=request.mesh.units, seen_from=request.mesh.seen_from
    )
    with _unpack_capture(Path(request.source)) as (source, within):
        posed = None
        if (video := Path(request.source)).suffix.lower() in VIDEOS:
            frames = VideoConfig(frames=frames_in(request.quality, request.budget))
            posed = yield from relay_import(make_capture_of_video(video, source, frames), "posing the video")
        photographs = request.photographs
        config = ImportConfig(
            request.placement, photographs.downscale, photographs.held_out_every, request.depth is not False, within
        )
        capture = yield from relay_import(import_capture(source, config), "reading photographs")
        if request.depth and not capture.report.images_with_depth:
            raise InvalidInputError(f"{source} has no depth maps (depth_file_path or depth_path) to learn with")
        return _material(capture, request.budget, posed)


def _material(capture: ImportedCapture, budget: float | None, posed: VideoReport | None) -> TrainingData:
    report, cut_out = asdict(capture.report), capture.learned.silhouettes is not None
    del report["input_keys"]  # stored with the field, and reported from there
    voxel = (capture.box.size.prod().item() / (_cut_out_nodes(budget) if cut_out else NODES)) ** (1 / 3)
    return TrainingData(
        capture.learned,
        capture.held_out,
        capture.box,
        capture.background,
        None,
        {**report, "kind": f"capture ({capture.report.kind})", **({} if posed is None else asdict(posed))},
        voxel,
        CUT_OUT_ITERATIONS if cut_out else ITERATIONS,
        capture.bounded,
        capture.report.camera,
        capture.report.placed,
        capture.report.input_keys,
    )


def _cut_out_nodes(budget: float | None) -> float:
    return CUT_OUT_NODES if budget is None else min(CUT_OUT_NODES, max(NODES, CUT_OUT_NODES_PER_SECOND * budget))


def frames_in(quality: QualityName, budget: float | None) -> int:
    """Frames that are taken of a video, at most: posing them is to leave time to train."""
    most = FRAMES[quality]
    return most if budget is None else min(most, max(FRAMES["draft"], round(FRAMES_PER_SECOND * budget)))


@contextmanager
def _unpack_capture(source: Path) -> Iterator[tuple[Path, Path | None]]:
    """Unpack the capture of an archive, for as long as it is read; give it with the folder that it may not read beyond.

    A capture that came as a file may come from anyone.
    """
    suffix = source.suffix.lower()
    if suffix not in (*ARCHIVES, *VIDEOS):
        yield source, None
        return
    with tempfile.TemporaryDirectory(prefix="nerfnav-", ignore_cleanup_errors=True) as folder:
        try:
            yield unpack_capture(source, Path(folder)) if suffix in ARCHIVES else Path(folder), Path(folder)
        except CaptureError as error:
            # the user knows the archive, not the folder that it was unpacked into
            raise CaptureError(str(error).replace(folder + os.sep, "").replace(folder, str(source))) from error
