"""Training data from a bundled scene: it is photographed here and now, and is its own ground truth."""

from collections.abc import Generator
from dataclasses import replace

import torch

import nerfnav_scenes as scenes
from nerfnav.core.steps import map_steps
from nerfnav.field import TrainConfig
from nerfnav.geometry import PosedImages
from nerfnav.importers.core.progress import ImportStep
from nerfnav.world import CaptureConfig, Scene, split
from nerfnav.world.capture import FINE_VOXEL, capture
from nerfnav_app.jobs.events import JobEvent
from nerfnav_app.jobs.field.request import TrainRequest
from nerfnav_app.jobs.field.training_data import Gathering, TrainingData, relay_import

LEAST_ITERATIONS, ITERATIONS_PER_CUBIC_METER = 400, 180
"""Training steps that a field needs: a larger place has more surface to learn."""
LEAST_IMAGES, IMAGES_PER_CUBIC_METER, MOST_IMAGES = 150, 60, 420
"""Photographs that show a place from everywhere."""
WITHOUT_DEPTH = 3
"""Photographs for each one that is enough with depth: without it, only colours that contradict each other prove space
to be free, and half a dozen views past a node seldom do."""


def render_views(source: str) -> bool:
    """Check for the name of a bundled scene."""
    return source in scenes.names()


def gather(request: TrainRequest) -> Gathering:
    """Photograph the scene. Raises InvalidInputError for options that only meshes and captures have."""
    placement = request.placement
    request.require_unset(
        "a bundled scene",
        up=placement.up,
        scale=placement.scale,
        picked=placement.picked,
        box=placement.box,
        downscale=request.photographs.downscale,
        units=request.mesh.units,
        seen_from=request.mesh.seen_from,
    )
    scene = scenes.load(request.source)
    # a place of the size of rooms takes as much work, in voxels, as a small one
    coarser = max(1.0, (scene.voxel or TrainConfig.voxel) / FINE_VOXEL)
    volume = scene.box.size.prod().item() / coarser**3
    rooms = coarser > 1  # places under the sky are seen through from all around, and proven by few pictures
    count = request.photographs.images or images_for(volume, with_depth=bool(request.depth) or not rooms)
    config = replace(request.capture.suiting(scene), images=count)
    photographs = yield from photograph(scene, config, torch.Generator().manual_seed(request.seed))
    report = {"kind": "scene", "images_used": len(photographs), "images_skipped": 0, "guesses": []}
    return training_data_of(scene, photographs if request.depth else photographs.without_depth(), report, volume)


def training_data_of(scene: Scene, photographs: PosedImages, report: dict[str, object], volume: float) -> TrainingData:
    """Training data of a scene, its own ground truth, as suits a box of `volume` [m^3]; some are held out."""
    return TrainingData(
        *split(photographs), scene.box, torch.tensor(scene.sky), scene, report, scene.voxel, iterations_for(volume)
    )


def images_for(volume: float, with_depth: bool = True) -> int:
    """Number of photographs for a box of `volume` [m^3], with or without depth that says what is free."""
    count = min(MOST_IMAGES, max(LEAST_IMAGES, round(IMAGES_PER_CUBIC_METER * volume)))
    return count if with_depth else WITHOUT_DEPTH * count


def iterations_for(volume: float) -> int:
    """Number of training steps for a box of `volume` [m^3]."""
    return max(LEAST_ITERATIONS, round(ITERATIONS_PER_CUBIC_METER * volume))


def photograph(
    scene: Scene, config: CaptureConfig, generator: torch.Generator
) -> Generator[JobEvent, bool | None, PosedImages]:
    """Take pictures of a scene's mesh and return them. Raises StoppedError where it is stopped."""
    doing = "photographing"
    pictures = capture(scene, config, generator)
    return relay_import(map_steps(pictures, lambda step: ImportStep(doing, (step.index + 1) / step.total)), doing)
