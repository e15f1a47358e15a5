"""Training data from a capture: a folder, a transforms.json, a .zip or .r3d of either, or a video."""

from dataclasses import asdict
from pathlib import Path

from nerfnav.core.errors import InvalidInputError
from nerfnav.importers import ImportConfig, ImportedCapture, import_capture, make_capture_of_video
from nerfnav.importers.core.kinds import VIDEOS
from nerfnav_app.jobs.field.request import TrainRequest
from nerfnav_app.jobs.field.training_data import Gathering, TrainingData, relay_import
from nerfnav_app.jobs.field.unpacking import capture_unpacked

ITERATIONS = 2000
"""Training steps that photographs ask for where nobody gave a number."""
NODES = 2_000_000
"""Nodes of the field of a capture, where nobody gave the size of a voxel: fifty photographs do not tell more apart, and
finer fields learn their noise (the fox: 22.5 dB with 6 million, 23.2 dB with 2)."""

CUT_OUT_ITERATIONS = 6000
"""The same where pictures are cut out: steps of few rays."""
CUT_OUT_NODES = 6_000_000
"""Nodes of the field of pictures that are cut out: most of them are empty."""
CUT_OUT_NODES_PER_SECOND = 60_000
"""Nodes for each second of a budget, at most: a grid that no ray has reached yet is worse than a coarse one."""


def gather(request: TrainRequest) -> Gathering:
    """Read the capture.

    Raises CaptureError where there is none that a field can be trained from, InvalidInputError for options that it
    has no use for.
    """
    request.require_unset(
        "a capture", images=request.photographs.count, units=request.mesh.units, seen_from=request.mesh.seen_from
    )
    with capture_unpacked(Path(request.source)) as (source, within):
        if (video := Path(request.source)).suffix.lower() in VIDEOS:
            yield from relay_import(make_capture_of_video(video, source), "posing the video")
        photographs = request.photographs
        config = ImportConfig(
            request.placement, photographs.downscale, photographs.held_out_every, request.depth is not False, within
        )
        capture = yield from relay_import(import_capture(source, config), "reading photographs")
        if request.depth and not capture.report.images_with_depth:
            raise InvalidInputError(f"{source} has no depth maps (depth_file_path) to learn with")
        return _material(capture, request.budget)


def _material(capture: ImportedCapture, budget: float | None) -> TrainingData:
    report, cut_out = asdict(capture.report), capture.learned.silhouettes is not None
    voxel = (capture.box.size.prod().item() / (_cut_out_nodes(budget) if cut_out else NODES)) ** (1 / 3)
    return TrainingData(
        capture.learned,
        capture.held_out,
        capture.box,
        capture.background,
        None,
        {**report, "kind": f"capture ({capture.report.kind})"},
        voxel,
        CUT_OUT_ITERATIONS if cut_out else ITERATIONS,
        capture.bounded,
        capture.report.camera,
        capture.report.placed,
    )


def _cut_out_nodes(budget: float | None) -> float:
    return CUT_OUT_NODES if budget is None else min(CUT_OUT_NODES, max(NODES, CUT_OUT_NODES_PER_SECOND * budget))
