"""Configuration of a tracker: numbers that suit photographs of real places."""

from dataclasses import dataclass, replace
from dataclasses import field as dataclass_field

from nerfnav.estimator import AlignConfig, FilterConfig, RelocaliseConfig
from nerfnav.estimator.relocalize.panorama import PanoramaConfig
from nerfnav.field import FieldInfo
from nerfnav.robots import StateNoise


@dataclass(frozen=True)
class TrackerConfig:
    """Options of a tracker."""

    filter: FilterConfig = dataclass_field(default_factory=FilterConfig)
    """Options of the posterior; its process noise is not used, and pixels and descents only without `align`."""
    align: AlignConfig | None = dataclass_field(default_factory=AlignConfig)
    """Alignment with renderings of the field; None: no alignment, the filter of flights
    (estimator/gauss_newton/fast_filter.py) is taken, which goes further astray in fields of photographs, but follows
    more abrupt motion in rendered ones."""
    search: RelocaliseConfig = dataclass_field(
        default_factory=lambda: RelocaliseConfig(
            looks=PanoramaConfig(spacing=0.03, most_places=2500),
            kept=(96, 20, 5, 2),
            iterations=(6, 6, 8, 10),
            pixels=448,
            settling_pixels=1500,
            gate=1.1,
        )
    )
    """Options of searches: sooner done than `localize`, and sooner in doubt, for the next picture comes soon."""
    floor: tuple[float, ...] = ()
    """Map error, 6 x 6 (see estimator/map_error.py); empty: `filter.floor` alone."""
    longest: int = 320
    """Larger pictures are made smaller until their longer edge has no more pixels than this: a field shows no more."""
    linear: float = 0.11
    """How strongly a hand moves the camera: spectral density of its acceleration [sizes/s per sqrt(s)], where a size is
    the longest edge of the field's box: in a capture without a measure, metres mean nothing, and in pixels a camera
    in a hall moves no more than one in a room."""
    angular: float = 0.6
    """The same of its turning [rad/s per sqrt(s)]."""
    found: StateNoise = dataclass_field(default_factory=lambda: StateNoise(0.008, 0.1, 0.03, 0.5))
    """Standard deviations of the belief after the camera was found, lengths in sizes."""
    around: StateNoise = dataclass_field(default_factory=lambda: StateNoise(0.03, 0.1, 0.1, 0.5))
    """A picture that fits badly is looked for as far around the prediction, lengths in sizes ..."""
    starts: int = 4
    """... from so many of the likeliest poses there."""
    patience: int = 3
    """Pictures in a row of no use after which the track is lost."""
    widest: float = 0.08
    """Standard deviation of a coordinate of the position from which the track is lost, too [sizes]."""
    between: float = 0.3
    """Time from one search to the next [s]."""
    suspicious: float = 1.35
    """A picture that differs this many times as much as those before it did is looked for around, then everywhere."""
    better: float = 1.15
    """The place that is found ends the track where the picture differs so many times less there."""
    unexplained: float = 0.33
    """Where the field does not show this share of a picture's variance from anywhere around, the picture contradicts:
    no pose is reported until one is found that does (with `align` alone)."""
    remembered: int = 30
    """Pictures of which the usual difference is taken."""

    def for_field(self, info: FieldInfo) -> "TrackerConfig":
        """Return the options with the measured properties of a field; pose errors of photographs go before the
        calibration of flights' filter."""
        known = info
        if info.pose_floor:
            floor = None if info.information_ratio is not None else info.position_floor_m
            known = replace(info, information_ratio=1.0, position_floor_m=floor)
        return replace(
            self,
            filter=self.filter.for_field(known),
            search=self.search.for_field(info),
            floor=info.pose_floor,
        )

    def in_place(self, size: float) -> "TrackerConfig":
        """Return the options with lengths in metres, for a place whose longest edge is `size` [m]."""
        found, around = (
            replace(noise, position_m=size * noise.position_m, velocity_mps=size * noise.velocity_mps)
            for noise in (self.found, self.around)
        )
        return replace(self, linear=size * self.linear, widest=size * self.widest, found=found, around=around)
