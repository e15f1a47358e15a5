"""Train: photograph a scene, learn a field from the pictures, store it."""

from collections.abc import Generator
from dataclasses import dataclass, field, replace
from pathlib import Path

import torch

import scenes
from app.events import JobEvent, JobEvents, JobFinished, JobStarted, Progress
from app.jobs.checks import require_positive
from app.jobs.outputs import prepare_file
from nerfnav.errors import InvalidInputError, NerfnavError
from nerfnav.field.checkpoint import save_field
from nerfnav.field.train import TrainConfig, train
from nerfnav.field.voxel import VoxelField
from nerfnav.geometry.images import PosedImages
from nerfnav.world.capture import CaptureConfig, capture, split
from nerfnav.world.scene import Scene

LEAST_ITERATIONS, ITERATIONS_PER_CUBIC_METER = 400, 180
"""Training steps that a field needs: a larger place has more surface to learn."""
MOST_VOXELS = 30_000_000
"""Training holds a dozen numbers for each voxel and thread."""
LEAST_HELD_OUT = 10
"""Photographs of which one is held out."""
LEAST_IMAGES, IMAGES_PER_CUBIC_METER, MOST_IMAGES = 150, 60, 420
"""Photographs that show a place from everywhere."""


class StoppedError(NerfnavError):
    """A job that was stopped before there was anything to keep."""


@dataclass(frozen=True)
class TrainRequest:
    """What to train from."""

    source: str
    """Name of a bundled scene."""
    out: Path
    """The file for the field."""
    seed: int = 0
    """Seed of the camera's poses and of the training."""
    iterations: int | None = None
    """Training steps; None: as many as the size of the scene asks for."""
    budget: float | None = None
    """Time to train [s], in place of a number of steps; the result then depends on the machine."""
    images: int | None = None
    """Photographs, every tenth of which is held out; None: as many as the size of the scene asks for."""
    config: TrainConfig = field(default_factory=TrainConfig)
    """How else to train."""
    capture: CaptureConfig = field(default_factory=CaptureConfig)
    """How else to take the pictures."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for numbers that no training can have."""
        require_positive(iterations=self.iterations, budget=self.budget, voxel=self.config.voxel)
        if self.images is not None and self.images < LEAST_HELD_OUT:
            raise InvalidInputError(f"images must be at least {LEAST_HELD_OUT}, one of them to test, not {self.images}")

    def train_config(self, volume: float) -> TrainConfig:
        """How to train in a box of `volume` [m^3]."""
        by_size = max(LEAST_ITERATIONS, round(ITERATIONS_PER_CUBIC_METER * volume))
        iterations = by_size if self.iterations is None else self.iterations
        return replace(self.config, iterations=iterations, budget=self.budget)

    def capture_config(self, volume: float) -> CaptureConfig:
        """How to photograph a box of `volume` [m^3]."""
        by_size = min(MOST_IMAGES, max(LEAST_IMAGES, round(IMAGES_PER_CUBIC_METER * volume)))
        return replace(self.capture, images=by_size if self.images is None else self.images)


def run(request: TrainRequest) -> JobEvents:
    """Yield progress of every picture and reports of the training, then the numbers of the stored field.

    Send True to end early: what was learned so far is then stored and reported as usual.
    Raises NerfnavError where the source is unknown or the file cannot be written.
    """
    scene = _scene_named(request.source)
    out = prepare_file(request.out)
    volume = scene.box.size.prod().item()
    if volume / request.config.voxel**3 > MOST_VOXELS:
        raise InvalidInputError(
            f"a field of {scene.name} with voxels of {request.config.voxel:g} m would have more than {MOST_VOXELS} "
            "of them: choose a larger --voxel"
        )
    yield JobStarted("train")
    generator = torch.Generator().manual_seed(request.seed)
    photographs = yield from _photograph(scene, request.capture_config(volume), generator)
    trained = yield from _learn(scene, photographs, request.train_config(volume), generator)
    # the source is what later finds the ground truth again
    trained = replace(trained, info=replace(trained.info, source=scene.name, seed=request.seed))
    file_bytes = save_field(trained, out)
    nx, ny, nz = trained.shape
    summary = {
        "psnr_db": trained.info.psnr_db,
        "train_s": trained.info.train_s,
        "voxels": nx * ny * nz,
        "file_bytes": file_bytes,
    }
    yield JobFinished("train", summary, (out,))


def _photograph(
    scene: Scene, config: CaptureConfig, generator: torch.Generator
) -> Generator[JobEvent, bool | None, PosedImages]:
    for step in capture(scene, config, generator):
        stop = yield Progress("photographing", (step.index + 1) / step.total)
        if stop:
            raise StoppedError("stopped while photographing: nothing was learned yet, so nothing is saved")
        if step.captured is not None:
            return step.captured
    raise AssertionError("a capture ends with its photographs")


def _learn(
    scene: Scene, photographs: PosedImages, config: TrainConfig, generator: torch.Generator
) -> Generator[JobEvent, bool | None, VoxelField]:
    learned, held_out = split(photographs)
    steps = train(learned, held_out, scene.box, torch.tensor(scene.sky), config, generator)
    step = next(steps)
    while step.field is None:
        yield step
        stop = yield Progress("training", step.fraction)
        step = steps.send(stop)
    yield step
    return step.field


def _scene_named(source: str) -> Scene:
    if source not in scenes.names() and Path(source).exists():
        raise InvalidInputError(
            f"{source} is a file, but fields are trained from bundled scenes only: {', '.join(scenes.names())}"
        )
    return scenes.load(source)
