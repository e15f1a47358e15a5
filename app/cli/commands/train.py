"""nerfnav train: from a scene, a mesh or a capture to a field."""

from dataclasses import dataclass, field
from typing import Annotated, Literal

from tyro.conf import OmitArgPrefixes, arg

from nerfnav.core.jit import use_threads
from nerfnav.importers import MeshOptions
from nerfnav_app.cli.arguments import PlacementArguments
from nerfnav_app.cli.progress import run_and_print
from nerfnav_app.cli.terminal import Output
from nerfnav_app.jobs.field.baked import run as run_baked
from nerfnav_app.jobs.field.request import NeuralOptions, TrainOptions, TrainRequest
from nerfnav_app.jobs.field.train import run as run_job


@dataclass(frozen=True)
class Arguments(TrainOptions, Output):
    """Train a field of a scene, a mesh or a capture; Ctrl-C stops early and keeps what was learned."""

    placement: OmitArgPrefixes[PlacementArguments] = field(default_factory=PlacementArguments)
    """Placement of a mesh or a capture in the world; what is not given is guessed, and the guess is printed."""
    mesh: OmitArgPrefixes[MeshOptions] = field(default_factory=MeshOptions)
    """Options of meshes."""
    kind: Annotated[Literal["voxel", "neural"], arg(name="field")] = "voxel"
    """Kind of field: voxels, or the networks of the paper, which need a GPU."""
    neural: OmitArgPrefixes[NeuralOptions] = field(default_factory=NeuralOptions)
    """Options of neural fields."""
    baked: bool = False
    """Of a mesh: make the field of the mesh itself, in seconds, without training."""
    threads: int | None = None
    """Threads to train on (default: one on each core)."""
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
    job = run_baked(request) if arguments.baked else run_job(request)
    with use_threads(arguments.threads):
        run_and_print(f"field {arguments.out}", job, arguments.json, can_stop_early=not arguments.baked)
