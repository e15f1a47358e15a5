"""What is known about a field beside its values: where it comes from and how good it is."""

from dataclasses import dataclass


@dataclass(frozen=True)
class FieldInfo:
    """Stored with a field, shown by `nerfnav info`."""

    source: str = ""
    """What the images were taken of: a bundled scene's name or a file's name."""
    created: str = ""
    """When it was trained, ISO 8601."""
    images: int = 0
    """Number of training images."""
    train_s: float = 0.0
    """Time that training took [s]."""
    psnr_db: float | None = None
    """Peak signal-to-noise ratio on held-out views [dB]; None if never measured."""
    noise_std: float | None = None
    """Standard deviation of the colour residual on held-out views, in [0, 1]: the measurement noise of the filter."""
    seed: int = 0
    """Seed of training."""
    iterations: int = 0
    """Training steps done."""
