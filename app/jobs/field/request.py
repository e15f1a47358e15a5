"""Request of a training: its source, options and quality.

Quality says how fine and how long, relative to what a source asks for, which follows from the size of the place and
from the pictures (see the `gather` of each source). A grid finer than the pictures' pixels learns their noise, so
pixels bound it.
"""

from dataclasses import dataclass, field
from pathlib import Path

from tyro.conf import OmitArgPrefixes, Positional

from nerfnav.core.errors import InvalidInputError, require_positive, require_seed
from nerfnav.field import TrainConfig
from nerfnav.geometry import Box, PosedImages
from nerfnav.importers import MeshOptions, Placement
from nerfnav.world import CaptureConfig
from nerfnav_app.places.sources import QualityName


@dataclass(frozen=True)
class Quality:
    """Quality of a training: resolution and time."""

    nodes: float
    """Nodes of the field, in those that the source asks for."""
    steps: float
    """Training steps, in those that the source asks for."""


QUALITIES: dict[QualityName, Quality] = {
    "draft": Quality(1 / 4, 1 / 3),
    "good": Quality(1.0, 1.0),
    "best": Quality(3.0, 4.0),
}


def voxel_of(quality: Quality, suited: float, pixel: float) -> float:
    """Distance of nodes [m] where a source asks for `suited` and its pixels show `pixel` [m] each."""
    wanted = suited * quality.nodes ** (-1 / 3)
    return wanted if quality.nodes <= 1 else min(suited, max(wanted, pixel))


def pixel_size(photographs: PosedImages, box: Box) -> float:
    """Size of a pixel at the middle of the box [m]: the median of the photographs."""
    middle = (box.lower + box.upper) / 2
    return float((photographs.poses.position - middle).norm(dim=-1).median()) / photographs.camera.fx


LEAST_HELD_OUT = 10
"""Photographs of a scene or mesh of which one is held out."""


@dataclass(frozen=True)
class Photographs:
    """Photographs to learn from."""

    images: int | None = None
    """Photographs to take of a scene or mesh, every tenth held out (default: by its size)."""
    downscale: int | None = None
    """Factor by which to shrink a capture's photographs (default: until none is slow to learn)."""
    held_out_every: int = 8
    """Hold out one of this many photographs of a capture, to judge the field."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for numbers that no training can have."""
        require_positive(downscale=self.downscale)
        if self.images is not None and self.images < LEAST_HELD_OUT:
            raise InvalidInputError(f"images must be at least {LEAST_HELD_OUT}, one of them to test, not {self.images}")
        if self.held_out_every < 2:
            raise InvalidInputError(f"at least every second photograph is learned from, not {self.held_out_every}")


@dataclass(frozen=True)
class NeuralOptions:
    """Networks of a neural field; the paper's by default."""

    layers: int = 8
    """Layers of each of the two networks."""
    layer_width: int = 256
    """Numbers in each layer."""
    rays: int = 1024
    """Rays in a training step."""
    device: str = "cpu"
    """Device of the training: cpu, or cuda for a GPU; without one, the paper's networks take days."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for networks that cannot be."""
        require_positive(layers=self.layers, layer_width=self.layer_width, rays=self.rays)
        if self.device.split(":")[0] not in ("cpu", "cuda"):
            raise InvalidInputError(f"the device is cpu or cuda, not {self.device!r}")


@dataclass(frozen=True)
class TrainOptions:
    """Source, file and options of a training. The command line reads them as they are."""

    source: Positional[str]
    """Name of a bundled scene, a mesh file, or a capture: its folder, its transforms.json, or a .zip of it."""
    out: Path
    """File for the field."""
    quality: QualityName = "good"
    """draft: coarse and quick; good: by the size and the pictures of the place; best: as fine as the pixels of the
    pictures, in four times the time."""
    budget: float | None = None
    """Time from reading to the stored field [s], in place of iterations; the result then depends on the machine."""
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


@dataclass(frozen=True)
class TrainRequest(TrainOptions):
    """Request of a training; voxel, iterations and budget take precedence over the quality."""

    placement: Placement = field(default_factory=Placement)
    """Placement of the source in the world."""
    mesh: MeshOptions = field(default_factory=MeshOptions)
    """Options of meshes."""
    config: TrainConfig = field(default_factory=TrainConfig)
    """Further settings of the training."""
    capture: CaptureConfig = field(default_factory=CaptureConfig)
    """Further settings of the photographs of scenes and meshes."""
    depth: bool | None = None
    """Learn with depth; None: where there is any, but for bundled scenes, which show what pictures do."""
    neural: NeuralOptions | None = None
    """The networks of a neural field; None: a voxel field is trained."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for numbers that no training can have."""
        require_positive(iterations=self.iterations, budget=self.budget, voxel=self.voxel, save_every=self.save_every)
        require_seed(seed=self.seed)
        if self.neural is not None and self.save_every is not None:
            raise InvalidInputError("save-every is for voxel fields: networks in training cannot be planned in")

    def require_unset(self, kind: str, **options: object) -> None:
        """Raise InvalidInputError, which names it, for an option that was given although a `kind` has no use for it."""
        for name, given in options.items():
            if given:
                option = name.replace("_", "-")
                raise InvalidInputError(f"{option} means nothing for {kind}, which {self.source} is: leave it out")
