"""nerfnav train: from a scene, a mesh or a capture to a field."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import OmitArgPrefixes, Positional, arg

from nerfnav.importers import MeshOptions
from nerfnav_app.cli.arguments import PlacementArguments
from nerfnav_app.cli.progress import run_and_print
from nerfnav_app.cli.terminal import Output
from nerfnav_app.jobs.field.request import NeuralOptions, Photographs, QualityName, TrainRequest
from nerfnav_app.jobs.field.train import run as run_job


@dataclass(frozen=True)
class Arguments(Output):
    """Train a field of a scene, a mesh or a capture; Ctrl-C stops early and keeps what was learned."""

    source: Positional[str]
    """Name of a bundled scene, a mesh file, or a capture: its folder, its transforms.json, or a .zip of it."""
    out: Path
    """File for the field."""
    quality: QualityName = "good"
    """draft: coarse and quick; good: by the size and the pictures of the place; best: as fine as the pixels of the
    pictures, in four times the time."""
    budget: float | None = None
    """Time to train [s], in place of iterations; the result then depends on the machine."""
    iterations: int | None = None
    """Training steps (default: by the source)."""
    save_every: float | None = None
    """Store the field so far in --out this often [s], to plan in it already."""
    seed: int = 0
    """Seed of the camera poses and of the training."""
    voxel: float | None = None
    """Size of a voxel [m] (default: by the source)."""
    photographs: OmitArgPrefixes[Photographs] = field(default_factory=Photographs)
    """Photographs to learn from."""
    placement: OmitArgPrefixes[PlacementArguments] = field(default_factory=PlacementArguments)
    """Placement of a mesh or a capture in the world; what is not given is guessed, and the guess is printed."""
    mesh: OmitArgPrefixes[MeshOptions] = field(default_factory=MeshOptions)
    """Options of meshes."""
    kind: Annotated[Literal["voxel", "neural"], arg(name="field")] = "voxel"
    """Kind of field: voxels, or the networks of the paper, which need a GPU."""
    neural: OmitArgPrefixes[NeuralOptions] = field(default_factory=NeuralOptions)
    """Options of neural fields."""
    depth: Literal["auto", "on", "off"] = "auto"
    """Learn from depth, of a mesh or of a capture that has it; auto: where there is any, except in bundled scenes."""


def run(arguments: Arguments) -> None:
    """Train, store the field, and print how good it is and what was guessed."""
    request = TrainRequest(
        arguments.source,
        arguments.out,
        quality=arguments.quality,
        save_every=arguments.save_every,
        seed=arguments.seed,
        iterations=arguments.iterations,
        budget=arguments.budget,
        voxel=arguments.voxel,
        photographs=arguments.photographs,
        placement=arguments.placement.placement(),
        mesh=arguments.mesh,
        depth={"auto": None, "on": True, "off": False}[arguments.depth],
        neural=arguments.neural if arguments.kind == "neural" else None,
    )
    run_and_print(f"field {arguments.out}", run_job(request), arguments.json, can_stop_early=True)
