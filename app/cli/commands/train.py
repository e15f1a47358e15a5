"""nerfnav train: from a scene, a mesh or a capture to a field."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import OmitArgPrefixes, Positional, arg

from nerfnav.importers import AXES, MeasuredDistance, MeshOptions, Placement
from nerfnav_app.cli.number_arguments import numbers_argument, parse_count, words_argument
from nerfnav_app.cli.progress import run_and_print
from nerfnav_app.jobs.field.request import NeuralOptions, Photographs, QualityName, TrainRequest
from nerfnav_app.jobs.field.train import run as run_job


def _up(words: list[str]) -> tuple[float, ...]:
    """A direction of three numbers, or an axis by its name."""
    return AXES[words[0]] if len(words) == 1 and words[0] in AXES else parse_count("up", 3, words)


Up = Annotated[tuple[float, ...] | None, words_argument("X Y Z|AXIS", _up)]
Picked = Annotated[tuple[float, ...] | None, numbers_argument("picked", "X Y Z X Y Z DISTANCE")]
Corners = Annotated[tuple[float, ...] | None, numbers_argument("box", "X Y Z X Y Z")]


@dataclass(frozen=True)
class PlacementArguments:
    """How a mesh or a capture lies in the world; what is not given is guessed, and the guess is printed."""

    up: Up = None
    """The direction that is up in the source's own axes: X Y Z, or the name of an axis (y, z)."""
    scale: float | None = None
    """Metres in one unit of the source."""
    picked: Picked = None
    """Another way to give the scale: two points in the source's own units, and their true distance [m]."""
    box: Corners = None
    """Lowest and highest corner of the field, after scale and up [m]."""

    def placement(self) -> Placement:
        """The same as jobs take it."""
        up, picked, box = (None if self.up is None else vector(self.up)), self.picked, self.box
        return Placement(
            up,
            self.scale,
            None if picked is None else measured_distance(picked),
            None if box is None else (vector(box[:3]), vector(box[3:])),
        )


@dataclass(frozen=True)
class PhotographArguments:
    """Which photographs are learned from."""

    images: int | None = None
    """Photographs that are taken of a scene or mesh, every tenth held out; by default as its size asks for."""
    downscale: int | None = None
    """A capture's photographs are made so many times smaller; by default until none is slow to learn."""
    held_out_every: int = 8
    """One of so many of a capture's photographs is held out to judge the field."""

    def photographs(self) -> Photographs:
        """The same as jobs take it."""
        return Photographs(self.images, self.downscale, self.held_out_every)


@dataclass(frozen=True)
class Arguments:
    """Train a field of a scene, a mesh or a capture; Ctrl-C stops early and keeps what was learned."""

    source: Positional[str]
    """A bundled scene's name, a mesh file, or a capture: its folder, its transforms.json, or a .zip of it."""
    out: Path
    """File for the field."""
    quality: QualityName = "good"
    """draft: coarser and briefer, to fly in soon; good: as the place's size and its pictures ask for; best: as fine as
    its pictures' pixels, and four times as long."""
    budget: float | None = None
    """Time to train [s], in place of a number of iterations; the result then depends on the machine."""
    iterations: int | None = None
    """Training steps; by default as many as the source asks for."""
    save_every: float | None = None
    """Time between two fields of what is learned so far [s]: each replaces FILE, so that one can plan in it already."""
    seed: int = 0
    """Seed of the camera's poses and of the training."""
    voxel: float | None = None
    """Size of the field's voxels [m]; by default what suits the source."""
    photographs: OmitArgPrefixes[PhotographArguments] = field(default_factory=PhotographArguments)
    """Which photographs are learned from."""
    placement: OmitArgPrefixes[PlacementArguments] = field(default_factory=PlacementArguments)
    """How a mesh or a capture lies in the world."""
    mesh: OmitArgPrefixes[MeshOptions] = field(default_factory=MeshOptions)
    """What only meshes leave open."""
    kind: Annotated[Literal["voxel", "neural"], arg(name="field")] = "voxel"
    """What is trained: voxels, or networks as the paper has them, which want a GPU."""
    neural: OmitArgPrefixes[NeuralOptions] = field(default_factory=NeuralOptions)
    """What only networks leave open."""
    depth: Literal["auto", "on", "off"] = "auto"
    """Whether depth teaches where surfaces are: a mesh's, or that of a capture which brings it; auto: where there is
    any, but for bundled scenes."""
    json: bool = False
    """Print one JSON object and nothing else."""


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
        photographs=arguments.photographs.photographs(),
        placement=arguments.placement.placement(),
        mesh=arguments.mesh,
        depth={"auto": None, "on": True, "off": False}[arguments.depth],
        neural=arguments.neural if arguments.kind == "neural" else None,
    )
    run_and_print(f"field {arguments.out}", run_job(request), arguments.json, can_stop_early=True)


def vector(numbers: tuple[float, ...]) -> tuple[float, float, float]:
    """Three numbers."""
    x, y, z = numbers
    return x, y, z


def measured_distance(numbers: tuple[float, ...]) -> MeasuredDistance:
    """Two points and their distance, from seven numbers."""
    return MeasuredDistance(vector(numbers[:3]), vector(numbers[3:6]), numbers[6])
