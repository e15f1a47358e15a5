"""Configuration, report and result of the import of a capture."""

from dataclasses import dataclass, field
from pathlib import Path

from jaxtyping import Float
from torch import Tensor

from nerfnav.formats import KeyReport
from nerfnav.geometry import Box, PosedImages
from nerfnav.importers.core.placement import Placement
from nerfnav.importers.core.progress import SparseModel


@dataclass(frozen=True)
class ImportConfig:
    """Options of a capture import."""

    placement: Placement = field(default_factory=Placement)
    """Up direction, scale and box of the capture."""
    downscale: int | None = None
    """Downscaling factor of the photographs; None: until the longest side has at most 640 pixels."""
    held_out_every: int = 8
    """Every n-th photograph is held out, unless the capture defines a test split."""
    depth: bool = True
    """Read depth maps where there are any."""
    within: Path | None = None
    """Folder outside of which no photograph is read, for untrusted captures; None: no restriction."""


@dataclass(frozen=True)
class CaptureReport:
    """Report of an import: counts, sizes, placement and guesses."""

    kind: str
    """Kind of capture: "transforms.json", "Blender", "COLMAP", "TUM RGB-D"."""
    images_named: int
    """Photographs that the files name."""
    images_used: int
    """Photographs that were read, held out ones among them."""
    images_skipped: int
    """Photographs that are missing or no readable images."""
    images_held_out: int
    """Photographs that judge the field."""
    image_size: tuple[int, int]
    """Width and height of the photographs after all [pixels]."""
    downscale: int
    """Downscaling factor."""
    images_with_depth: int
    """Photographs with a depth map."""
    images_with_mask: int
    """Photographs with a mask of the pixels that count."""
    points: int
    """Points that structure from motion found in three photographs or more, which the capture brings."""
    scale: float
    """Metres in one unit of the capture."""
    up: tuple[float, ...]
    """The direction that is up, in the capture's own axes."""
    box: tuple[tuple[float, ...], tuple[float, ...]]
    """Lowest and highest corner of the field [m]."""
    camera: tuple[float, ...]
    """Camera of the first photograph, as `Camera.numbers`; empty for lenses with more coefficients than those hold."""
    placed: tuple[float, ...]
    """Similarity from the capture's coordinates to the field's: `Similarity.numbers`."""
    guesses: tuple[str, ...]
    """Choices between files, and placement that was neither given nor certain: one sentence each."""
    input_keys: KeyReport
    """Keys of the capture's files: used, ignored (with the reason) and unknown."""


@dataclass(frozen=True, eq=False)
class ImportedCapture:
    """Capture that is ready to train from."""

    learned: PosedImages
    """Photographs to learn from."""
    held_out: PosedImages
    """Photographs that judge the field."""
    box: Box
    """Box of the field [m]."""
    background: Float[Tensor, "3"]
    """sRGB colour behind everything, in [0, 1]: white behind cut-out pictures, else the photographs' mean."""
    bounded: bool
    """True for cut-out pictures: nothing is outside the box."""
    report: CaptureReport
    """Counts, sizes, placement and guesses."""
    model: SparseModel
    """Cameras and points, to be shown before there is a field."""
