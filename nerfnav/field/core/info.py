"""Field metadata: the origin of a field, and measures of how good it is."""

from dataclasses import dataclass, fields
from typing import Any


@dataclass(frozen=True)
class FieldInfo:
    """Stored with a field, shown by `nerfnav info`."""

    source: str = ""
    """What the images were taken of: a bundled scene's name or a file's name."""
    truth: str = ""
    """Name of the file beside the field's that holds its ground truth; empty where there is none."""
    truth_sha256: str = ""
    """What that file must hold."""
    created: str = ""
    """When it was trained, ISO 8601."""
    images: int = 0
    """Number of training images."""
    train_s: float = 0.0
    """Time that training took [s]."""
    psnr_db: float | None = None
    """Peak signal-to-noise ratio on held-out views [dB]; None if never measured."""
    psnr_one_exposure_db: float | None = None
    """The same with a gain of each view taken out [dB]; None where all have the same exposure."""
    noise_std: float | None = None
    """Standard deviation of the colour residual on held-out views, in [0, 1], exposure taken out: the measurement noise
    of the filter."""
    noise_core_std: float | None = None
    """The same without its outliers, from the median (see field/train/evaluation.py)."""
    outlier_share: float | None = None
    """Share of pixels on held-out views that are outliers of the latter."""
    learned_from: str = ""
    """What taught it where things are: "pictures", or "pictures and depth"; empty where nobody noted it."""
    proven_from: str = ""
    """What proves space to be free in it: "pictures" or "depth"; empty where nothing does, or nobody noted it."""
    surface_taken_for_free: float | None = None
    """Share of true surface that planners take for free; None where nothing tells where surfaces are."""
    free_taken_for_free: float | None = None
    """Share of truly free space that planners take for free; None likewise."""
    unproven_share: float | None = None
    """Share of the box that is neither proven free nor solid; None where that was never asked."""
    seed: int = 0
    """Seed of training."""
    iterations: int = 0
    """Training steps done."""
    baked_psnr_db: float | None = None
    """PSNR between this field and the one that it was baked from, on sample views [dB]; None if it was not baked."""

    camera: tuple[float, ...] = ()
    """What its photographs were taken with, as `Camera.numbers` has it; empty where nobody noted it."""
    placed: tuple[float, ...] = ()
    """How it lies in the capture that it was trained from: `Similarity.numbers` of what takes the capture's own
    coordinates to the field's; empty where nobody noted it."""
    views: tuple[float, ...] = ()
    """Where its photographs were taken from, seven numbers each (see estimator/relocalize/capture_prior.py); empty
    where nobody noted it."""
    position_floor_m: float | None = None
    """How far off positions found in pictures of it are, along each coordinate, beyond what a picture says itself [m],
    as a standard deviation (see estimator/map_error.py); None where nobody measured it."""
    pose_floor: tuple[float, ...] = ()
    """How far poses that fit a picture best are from the true ones, as a covariance (see estimator/map_error.py),
    6 x 6, row by row; empty where nobody measured it."""
    guesses: tuple[str, ...] = ()
    """What was guessed of up, lengths and box when it was made, sentences; what was put right since is left out."""

    @classmethod
    def of(cls, stored: dict[str, Any]) -> "FieldInfo":
        """From names and values in a file; names that this version does not know are left out."""
        known = {field.name for field in fields(cls)}
        told = {name: value for name, value in stored.items() if name in known}
        # files have lists
        listed = {name: tuple(told.get(name, ())) for name in ("guesses", "camera", "placed", "views", "pose_floor")}
        return cls(**{**told, **listed})
