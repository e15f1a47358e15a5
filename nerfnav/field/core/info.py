"""Field metadata: the origin of a field, and measures of how good it is."""

import math
from dataclasses import dataclass
from typing import Any

import msgspec

from nerfnav.formats import KeyReport


@dataclass(frozen=True)
class FieldInfo:
    """Origin and quality of a field, stored with it and shown by `nerfnav info`."""

    source: str = ""
    """Name of the bundled scene, or of the file, that the images show."""
    truth: str = ""
    """Name of the file beside the field's that holds its ground truth; empty where there is none."""
    truth_sha256: str = ""
    """SHA-256 of that file."""
    created: str = ""
    """When it was trained, ISO 8601."""
    images: int = 0
    """Number of training images."""
    train_s: float = 0.0
    """Duration of the training [s]."""
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
    made_by: str = ""
    """Origin of its values: "trained" from pictures, "baked" from a mesh or another field, or "imported"; of a capture
    that is still to be trained on, "fused" from depth or "draft" of a short training; empty where unknown."""
    learned_from: str = ""
    """Source of its geometry: "pictures", "pictures and depth" or "mesh"; empty where unknown."""
    proven_from: str = ""
    """Source of its proofs of free space: "pictures", "depth", or "mesh", where free space is connected to places where
    a camera may stand; empty where there is none, or it is unknown."""
    surface_taken_for_free: float | None = None
    """Share of true surface that planners take for free; None without a ground truth."""
    free_taken_for_free: float | None = None
    """Share of truly free space that planners take for free; None likewise."""
    unproven_share: float | None = None
    """Share of the box that is neither proven free nor solid; None where that was never determined."""
    seed: int = 0
    """Seed of training."""
    iterations: int = 0
    """Training steps done."""
    baked_psnr_db: float | None = None
    """PSNR between this field and the one that it was baked from, on sample views [dB]; None if it was not baked."""

    camera: tuple[float, ...] = ()
    """Camera of its photographs, as `Camera.numbers`; empty where unknown."""
    placed: tuple[float, ...] = ()
    """`Similarity.numbers` of the transform from the coordinates of its capture to the field's; empty where unknown."""
    views: tuple[float, ...] = ()
    """Poses of its photographs, seven numbers each (see estimator/relocalize/capture_prior.py); empty where unknown."""
    position_floor_m: float | None = None
    """Error of the map: standard deviation of positions found in pictures, along each coordinate, beyond the noise of
    the picture itself [m] (see estimator/map_error.py); None where it was never measured."""
    attitude_floor_rad: float | None = None
    """The same of attitudes [rad] (see estimator/calibration.py); None likewise."""
    information_ratio: float | None = None
    """Factor by which a picture tells less than the filter claims; None where it was never calibrated."""
    failed_share: float | None = None
    """Share of corrections by pictures from known poses that failed; None likewise."""
    pose_floor: tuple[float, ...] = ()
    """Error of the map: covariance of the poses that fit a picture best against the true ones (see
    estimator/map_error.py), 6 x 6, row by row; empty where it was never measured."""
    guesses: tuple[str, ...] = ()
    """Sentences on what was guessed of up, lengths and box when it was made; guesses corrected since are left out."""
    input_keys: KeyReport | None = None
    """Keys of its capture's files: used, ignored (with the reason) and unknown; None where unknown."""

    @property
    def is_draft(self) -> bool:
        """Check that the field is of a capture that is still to be trained on."""
        return self.made_by in ("fused", "draft")

    @property
    def is_uncalibrated(self) -> bool:
        """Check that the field was trained, or baked from a mesh, and never compared with pictures from known poses."""
        learned = self.noise_std is not None or self.learned_from == "mesh"
        return learned and self.information_ratio is None and self.position_floor_m is None

    @classmethod
    def of(cls, stored: dict[str, Any]) -> "FieldInfo":
        """From names and values in a file; names that this version does not know are left out.

        Raises ValueError for a value of another type, and for lists of numbers of other lengths or not finite.
        """
        info = msgspec.convert(stored, cls)
        for name, count in _COUNTS.items():
            numbers: tuple[float, ...] = getattr(info, name)
            if len(numbers) % count or not all(map(math.isfinite, numbers)):
                raise ValueError(f"its entry {name!r} has {len(numbers)} numbers, not {count} finite ones each")
        return info


_COUNTS = {"camera": 1, "placed": 13, "views": 7, "pose_floor": 36}
"""Lists of finite numbers, and the count of one entry of each."""
