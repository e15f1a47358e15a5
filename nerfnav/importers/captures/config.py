"""Configuration, report and result of the import of a capture."""

from dataclasses import dataclass, field
from pathlib import Path

from jaxtyping import Float
from torch import Tensor

from nerfnav.geometry import Box, PosedImages
from nerfnav.importers.core.placement import Placement


@dataclass(frozen=True)
class ImportConfig:
    """How a capture is imported."""

    placement: Placement = field(default_factory=Placement)
    """Where up is, how long a metre is, which part is wanted."""
    downscale: int | None = None
    """How many times smaller the photographs are made; None: until the longest side has at most 640 pixels."""
    held_out_every: int = 8
    """One of so many photographs is held out, unless the capture itself says which."""
    depth: bool = True
    """Whether depth maps are read where there are any."""
    within: Path | None = None
    """Folder outside of which no photograph is read, for captures that anybody may have brought; None: anywhere."""


@dataclass(frozen=True)
class CaptureReport:
    """What was found, and what was guessed."""

    kind: str
    """Which kind of files: "transforms.json", "Blender", "COLMAP"."""
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
    """How many times smaller they were made."""
    images_with_depth: int
    """Photographs with a depth map."""
    points: int
    """Points that structure from motion found in three photographs or more, which the capture brings."""
    scale: float
    """Metres in one unit of the capture."""
    up: tuple[float, ...]
    """The direction that is up, in the capture's own axes."""
    box: tuple[tuple[float, ...], tuple[float, ...]]
    """Lowest and highest corner of the field [m]."""
    camera: tuple[float, ...]
    """What the first photograph was taken with, as `Camera.numbers` has it; empty for lenses of more numbers."""
    placed: tuple[float, ...]
    """What takes the capture's own coordinates to the field's: `Similarity.numbers`."""
    guesses: tuple[str, ...]
    """What nobody said and the cameras do not tell for sure: one sentence each."""


@dataclass(frozen=True, eq=False)
class ImportedCapture:
    """Ready to train from."""

    learned: PosedImages
    """Photographs to learn from."""
    held_out: PosedImages
    """Photographs that judge the field."""
    box: Box
    """Where the field lives [m]."""
    background: Float[Tensor, "3"]
    """sRGB colour behind everything, in [0, 1]: white behind cut-out pictures, else the photographs' mean."""
    bounded: bool
    """Whether the pictures are cut out, so that nothing lies outside the box."""
    report: CaptureReport
    """What was found and guessed."""


@dataclass(frozen=True)
class ImportStep:
    """Where importing stands."""

    fraction: float
    """Share that is done, 0 to 1."""
    capture: ImportedCapture | None = None
    """The capture; set on the last step."""
