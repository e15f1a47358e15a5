"""Filter configuration: the options that all filters share, and those of each.

`FilterConfig` holds the options of all filters, for users who choose a filter by name.
"""

from dataclasses import dataclass, field, replace
from typing import TypeVar

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.errors import require_positive
from nerfnav.estimator.photometric.levenberg_marquardt import Prior, join_information
from nerfnav.estimator.photometric.pixel_selection import PixelConfig
from nerfnav.estimator.photometric.pyramid import PyramidConfig
from nerfnav.estimator.photometric.residuals import ColorNoise
from nerfnav.field import FieldInfo
from nerfnav.robots import StateNoise


@dataclass(frozen=True)
class DescentConfig:
    """Options of Adam on the manifold (paper Eq. 8)."""

    iterations: int = 300
    """Steps at most (paper: 300)."""
    memory: float = 0.9
    """Adam's beta_2. With the usual 0.999 the steep start is remembered to the end, and the flat valley in which
    position and attitude trade against each other is never followed down."""
    position_rate: float = 5e-3
    """Learning rate of the position [m]: about the length of a first step."""
    velocity_rate: float = 5e-3
    """Learning rate of the velocity [m/s]."""
    attitude_rate: float = 5e-3
    """Learning rate of the attitude [rad]."""
    body_rate_rate: float = 5e-3
    """Learning rate of the body rate [rad/s]."""
    final_rate: float = 0.05
    """The learning rates fall exponentially to this share of their first value."""
    stop_change: float | None = None
    """Stop when no pose number moved more than this in `stop_window` steps [m, rad]; None (paper): never."""
    stop_window: int = 10
    """Steps over which `stop_change` is judged."""
    recursive: bool = True
    """Take each step in the tangent of the state before it; False: all in the tangent of the start."""

    def rates(self) -> Float[Tensor, "12"]:
        """Return the first learning rate of each tangent number."""
        parts = (self.position_rate, self.velocity_rate, self.attitude_rate, self.body_rate_rate)
        return torch.tensor(parts, dtype=torch.float32).repeat_interleave(3)


@dataclass(frozen=True)
class UpdateConfig:
    """Options that all filters share: pixels, noise, gates."""

    pixels: PixelConfig = field(default_factory=PixelConfig)
    """Selection of the compared pixels."""
    process_noise: StateNoise = field(default_factory=StateNoise)
    """Q, the noise that each time step adds (paper: 0.1 I, far more than its simulator's 2 cm, 0.02 rad)."""
    color_noise: ColorNoise = field(default_factory=ColorNoise)
    """S, the measurement noise; its `std` should be the field's own, see `for_field`."""
    innovation_gate: float = 80.0
    """DIVERGED when the process term ends above this (chi-squared of 12 numbers: above 39 once in 10,000)."""
    residual_gate: float = 2.0
    """DIVERGED when the median difference ends above this many standard deviations of the noise."""
    least_contrast: int = 4
    """Least difference of colours in a usable picture [levels of 255]."""


@dataclass(frozen=True)
class PaperConfig(UpdateConfig):
    """Options of the paper's filter."""

    descent: DescentConfig = field(default_factory=DescentConfig)
    """Minimisation of the cost by Adam."""
    retries: int = 2
    """Where most pixels disagree in the end, descend again this often (paper: 0): details in a picture are finer
    than a kick of 5 cm, so some descents end in a false minimum, which shows in the residual."""
    candidates: int = 64
    """Random states of the prediction, of which a further descent starts at the best."""


Config = TypeVar("Config", bound="FastConfig")


@dataclass(frozen=True)
class FastConfig(UpdateConfig):
    """Options of the Gauss-Newton filters."""

    pyramid: PyramidConfig = field(default_factory=PyramidConfig)
    """Minimisation of the cost by Gauss-Newton, from coarse to fine."""
    floor: StateNoise = field(default_factory=lambda: StateNoise(0.0005, 0.0, 0.0005, 0.0))
    """Least standard deviations of a posterior: errors of field and camera models that no picture reduces."""
    grain: float = 0.055
    """Least standard deviation of the position as a share of the distance of the field's nodes, where that is more and
    it was not measured (see `for_field`): a field learned from photographs places its surfaces no more exactly, and
    errs alike in picture after picture."""
    exact_covariance: bool = False
    """Take the exact Hessian (paper) instead of Gauss-Newton's, which is at hand."""
    gain_std: float = 0.1
    """Standard deviation of a picture's gain from that of the photographs that the field learned from (paper: 0)."""
    bias_std: float = 0.05
    """The same for a constant added to its colours [1 = full scale] (paper: 0)."""
    adaptive: bool = True
    """Adapt the sizes of Q and S to each picture (see prediction.py; paper: no)."""
    uncalibrated: float = 4.0
    """Factor by which a picture tells less in a trained field that was never calibrated (see calibration.py): standard
    deviations are twice as wide."""
    noise_trust: float = 1.5
    """Degrees of freedom of the prior on Q's size where it is adapted."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for a factor that is none."""
        require_positive(uncalibrated=self.uncalibrated)

    def floor_at(self, grain: float) -> StateNoise:
        """Return the least standard deviations of a posterior in a field whose nodes are `grain` [m] apart."""
        return replace(self.floor, position_m=max(self.floor.position_m, self.grain * grain))

    def for_field(self: Config, info: FieldInfo) -> Config:
        """Return the options with a field's measured noise and its calibration; a floor that was set by hand stays.

        A picture of a field that was trained, or baked from a mesh, but never calibrated tells `uncalibrated` times
        less.
        """
        ratio = info.information_ratio
        if ratio is None:
            ratio = self.uncalibrated if info.is_uncalibrated else 1.0
        usual, noise = FastConfig(), self.color_noise.measured(info.noise_std)
        known = replace(self, color_noise=replace(noise, per_patch=noise.per_patch / ratio))
        if info.position_floor_m is None or (self.floor, self.grain) != (usual.floor, usual.grain):
            return known
        attitude = self.floor.attitude_rad if info.attitude_floor_rad is None else info.attitude_floor_rad
        floor = replace(self.floor, position_m=info.position_floor_m, attitude_rad=attitude)
        return replace(known, floor=floor, grain=0.0)


def exposure_prior(noise: ColorNoise, pixels: int, patches: float, slack: float = 0.0) -> Prior:
    """Return the prior of a descent that knows the exposure alone, and compares so many pixels of so many patches.

    `slack` is how far surfaces are misplaced over the noise of colours [m].
    """
    kappa = 1 / (noise.alike_of(pixels, patches) * noise.std**2)
    return Prior(join_information(None, (FastConfig.gain_std, FastConfig.bias_std)), None, kappa, slack)


@dataclass(frozen=True)
class FilterConfig(FastConfig, PaperConfig):
    """Options of all filters. The defaults are matched to the simulator; `paper()` returns the paper's choice."""

    @classmethod
    def paper(cls) -> "FilterConfig":
        """Return the paper's numbers: 300 steps without early stop, 256 pixels, Q = 0.1 I."""
        return cls(process_noise=StateNoise.isotropic(0.1), adaptive=False, retries=0)
