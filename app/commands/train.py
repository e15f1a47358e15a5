"""nerfnav train: from a scene to a field."""

from dataclasses import dataclass
from pathlib import Path

from tyro.conf import Positional

import scenes
from app.commands.screen import follow, show
from app.jobs.train import TrainRequest
from app.jobs.train import run as run_job
from nerfnav.field.train import TrainConfig


@dataclass(frozen=True)
class Arguments:
    """Photograph a scene and train a field from the pictures; Ctrl-C stops early and keeps what was learned."""

    source: Positional[str]
    """Name of a bundled scene."""
    out: Path
    """File for the field."""
    budget: float | None = None
    """Time to train [s], in place of a number of iterations; the result then depends on the machine."""
    iterations: int | None = None
    """Training steps; by default as many as the size of the scene asks for."""
    seed: int = 0
    """Seed of the camera's poses and of the training."""
    voxel: float | None = None
    """Size of the field's voxels [m]; by default what suits the scene."""
    images: int | None = None
    """Number of photographs, every tenth held out to judge the field; by default as the size of the scene asks."""
    json: bool = False
    """Print one JSON object and nothing else."""


def run(arguments: Arguments) -> None:
    """Train, store the field, and print how good it is."""
    request = TrainRequest(
        arguments.source,
        arguments.out,
        seed=arguments.seed,
        iterations=arguments.iterations,
        budget=arguments.budget,
        images=arguments.images,
        config=TrainConfig(voxel=_voxel(arguments)),
    )
    show(f"field {arguments.out}", follow(run_job(request), can_stop_early=True).summary, arguments.json)


def _voxel(arguments: Arguments) -> float:
    if arguments.voxel is not None:
        return arguments.voxel
    suits = scenes.load(arguments.source).voxel if arguments.source in scenes.names() else None
    return TrainConfig.voxel if suits is None else suits
