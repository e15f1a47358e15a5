"""How a camera is tracked: numbers that suit photographs of real places."""

from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field

from nerfnav.estimator import FilterConfig, PixelConfig, RelocaliseConfig, StateNoise
from nerfnav.estimator.looks import LooksConfig
from nerfnav.estimator.pixels import PixelDraw
from nerfnav.estimator.pyramid import PyramidConfig
from nerfnav.field import FieldInfo


def _photographs_filter() -> FilterConfig:
    """Pixels of the whole picture at full size: around features, and in smaller pictures, poses are further off."""
    pyramid = PyramidConfig(
        halvings=(0, 0), robust=(0.3, 0.1), iterations=(8, 8), pixels=768, coarse_pixels=256, narrow=8.0
    )
    return FilterConfig(pixels=PixelConfig(draw=PixelDraw.UNIFORM), pyramid=pyramid)


@dataclass(frozen=True)
class TrackerConfig:
    """How a camera is tracked."""

    filter: FilterConfig = dataclass_field(default_factory=_photographs_filter)
    """How pictures correct; its process noise is not used."""
    search: RelocaliseConfig = dataclass_field(
        default_factory=lambda: RelocaliseConfig(
            looks=LooksConfig(most_places=1200), kept=(96, 20, 5, 2), iterations=(6, 6, 8, 10), pixels=448, gate=1.1
        )
    )
    """How it is looked for: sooner done than `localize`, and sooner in doubt, for the next picture comes soon."""
    floor: tuple[float, ...] = ()
    """What does not average out, 6 x 6, see estimator/pose_error.py; none: `filter.floor` alone."""
    longest: int = 320
    """Larger pictures are made smaller until their longer edge has no more pixels than this: a field shows no more."""
    linear: float = 0.4
    """How strongly a hand moves the camera: spectral density of its acceleration [m/s per sqrt(s)]."""
    angular: float = 0.6
    """The same of its turning [rad/s per sqrt(s)]."""
    found: StateNoise = dataclass_field(default_factory=lambda: StateNoise(0.03, 0.4, 0.03, 0.5))
    """Spread of the belief after the camera was found."""
    patience: int = 3
    """Pictures in a row of no use after which the track is lost."""
    widest: float = 0.3
    """Standard deviation of a coordinate of the position from which the track is lost, too [m]."""
    between: float = 0.3
    """Time from one search to the next [s]."""
    suspicious: float = 1.35
    """A picture that differs this many times as much as those before it did is looked for everywhere, too."""
    better: float = 1.15
    """The place that is found ends the track where the picture differs so many times less there."""
    remembered: int = 30
    """Pictures that tell how much they usually differ."""

    def for_field(self, info: FieldInfo) -> "TrackerConfig":
        """The same with what was measured of a field."""
        return replace(self, filter=self.filter.for_field(info.noise_std), floor=info.pose_floor)
