"""Image pyramid: a picture at several sizes, each compared with the field at about the same sharpness.

Gauss-Newton from one scale converges from two or three pixels away. Reduced by 2^k, a picture forgives 2^k as much.
"""

import math
from dataclasses import dataclass, field

import torch
from jaxtyping import UInt8
from torch import Tensor

from nerfnav.core.errors import InvalidNumberError, require_not_negative, require_positive
from nerfnav.estimator.photometric.pixel_selection import Hidden, PixelDraw
from nerfnav.estimator.photometric.residuals import FieldCamera, Observation
from nerfnav.field import Field, GridField
from nerfnav.geometry import Camera, Pose, downsample_image

_LONGEST = 320
"""Longer edge of a picture beyond which a field shows no more [pixels]."""


@dataclass(frozen=True)
class Stage:
    """Stage of a descent, at one size of the picture."""

    halvings: int
    """The picture is reduced by 2 to this."""
    robust: float
    """Colour difference beyond which a pixel pulls less and less (Huber) [1 = full scale]."""
    iterations: int
    """Steps at most."""
    pixels: int
    """Pixels compared at most."""
    kept: int | None
    """Poses that go on from here, the likeliest; None: a third of them."""
    every: bool = True
    """Yield each step; False: the last one alone."""


@dataclass(frozen=True)
class SearchConfig:
    """Options of the search for other minima, where a descent seems to have ended in a false one.

    What little shows in a poor picture is lost when it is made smaller. So here random states of the prediction are
    compared with the picture at full size, around its features, and the likeliest are improved, ever fewer of them. The
    best so far rivals them before the last stage, and where it wins, that is left out.

    So much can be done between two pictures, counted in rays and not in time, that equal seeds give equal flights. A
    search that found nothing goes on with the next picture, from other random states.
    """

    doubt: float = 1.6
    """Look again where the colours' root mean square difference (Huber) ends above this many standard deviations."""
    patches: float = 15.0
    """Look for other minima also where a picture has fewer patches than this (see `patches` in residuals.py): little
    that it shows is soon taken for something like it."""
    rounds: int = 1
    """Times at most, in one update, that random states are drawn and the likeliest improved: what a search may take. It
    goes on with the next picture."""
    candidates: int = 48
    """Random states that are looked at in a round ..."""
    starts: int = 4
    """... and how many of them are improved."""
    saturation: float = 0.3
    """Colour differences above this count as this, in the choice of those [1 = full scale]."""
    alike: tuple[float, float] = (0.005, 0.01)
    """Poses nearer than this are one minimum: position [m], attitude [rad]."""
    pixels: tuple[int, ...] = (48, 96)
    """Pixels compared in each stage but the last: this compares those of the descent that it rivals."""
    robust: tuple[float, ...] = (1.0, 0.3, 0.1)
    """Huber's threshold in each stage [1 = full scale]."""
    iterations: tuple[int, ...] = (5, 6, 4)
    """Steps of each stage, at most."""
    kept: tuple[int, ...] = (2, 1, 1)
    """Poses that are left after each stage."""

    def stages(self, last: int) -> list[Stage]:
        """Return all stages, at full size, the last one at so many pixels."""
        table = zip(self.robust, self.iterations, (*self.pixels, last), self.kept, strict=True)
        return [Stage(0, *row, every=False) for row in table]


@dataclass(frozen=True)
class SecantConfig:
    """Options of secants in the filter (gauss_newton/secant.py)."""

    checked: int = 192
    """Pixels by which the information of a picture is measured, and steps by secants are taken."""
    overstated: float = 1.5
    """Slopes at a pose hold while the standard deviations that secants leave are at most this many times as large
    (geometric mean). It is 0.9 in Stonehenge, 2 to 4 in plain rooms."""
    widened: float = 2.0
    """Measurement begins over so many times the standard deviations that slopes leave: an end that stalled is about as
    far off."""
    settle: int = 3
    """Rounds of the measurement."""
    rounds: int = 5
    """Steps of a descent by secants."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for numbers that measure nothing."""
        require_positive(checked=self.checked, widened=self.widened, settle=self.settle)
        require_not_negative(rounds=self.rounds)


@dataclass(frozen=True)
class PyramidConfig:
    """Options of the descent from coarse to fine."""

    halvings: tuple[int, ...] = (2, 1, 0, 0)
    """Each stage's picture is reduced by 2 to this; those that are not are compared at chosen pixels."""
    robust: tuple[float, ...] = (1.0, 0.5, 0.1, 0.1)
    """Colour difference beyond which a pixel pulls less and less in each stage (Huber) [1 = full scale]."""
    iterations: tuple[int, ...] = (6, 8, 10, 12)
    """Steps of each stage, at most."""
    thorough: int = 2
    """Times as many steps where one start is not enough."""
    mistrust: float = 3.0
    """Variance of colours grows by this with every halving: coarse fields are poor likenesses, and must not drag a good
    prediction away."""
    misplaced: float = 0.05
    """Distance of a learned field's surfaces from their places [share of the distance of its nodes]: colours that are
    steep there count less (see levenberg_marquardt.py)."""
    pixels: int = 768
    """Pixels compared in the end, at most."""
    draw: PixelDraw = PixelDraw.BOTH
    """Selection of those."""
    coarse_pixels: int = 192
    """Pixels compared in each stage before that, at most: these only lead to where the last one begins."""
    stretch: float = 2.0
    """The most that steps are stretched (see levenberg_marquardt.py): more overshoots."""
    settled: float = 6e-4
    """The last stage ends when a step moves no pose number further than this [m, rad]; one reduced by 2^k, 2^k times
    as soon."""
    candidates: int = 96
    """Where the prediction is wider than `narrow`, as many random states of it are looked at ..."""
    glance: int = 48
    """... at so many pixels ..."""
    starts: int = 8
    """... and this many of them, the likeliest, are improved; each later stage goes on with a third."""
    rays: int = 12_000
    """Rays that one stage before the last follows at most: many poses are compared at fewer pixels each."""
    narrow: float = 2.4
    """Standard deviation of the prediction, in pixels of the first stage, from which one start may not be enough."""
    search: SearchConfig = field(default_factory=SearchConfig)
    """Search where the result is doubtful."""
    secant: SecantConfig = field(default_factory=SecantConfig)
    """Secant statistics where slopes at a point overstate what a picture tells."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for steps that would be shortened, or go back."""
        if not 1 <= self.stretch < math.inf:
            raise InvalidNumberError("stretch", "a number, at least 1", self.stretch)

    def stages(self, many: bool) -> list[Stage]:
        """Return all stages; the last but one leaves one pose, and each before the last is yielded as one step."""
        table = list(zip(self.halvings, self.robust, self.iterations, strict=True))
        last = len(table) - 1
        return [
            Stage(halvings, robust, most * (self.thorough if many else 1),
                  self.pixels if index == last else min(self.pixels, self.coarse_pixels),
                  1 if index + 1 >= last else None, every=index == last)
            for index, (halvings, robust, most) in enumerate(table)
        ]  # fmt: skip


@dataclass(frozen=True)
class View:
    """Field at all levels of sharpness, and a camera on its mount."""

    levels: tuple[Field, ...]
    """The field, and ever coarser ones (see field/models/levels.py)."""
    camera: Camera
    """Camera of the pictures."""
    mount: Pose
    """T_body_camera."""

    @property
    def grain(self) -> float:
        """Distance of the field's nodes [m]; 0 where it is no grid."""
        field = self.levels[0]
        return field.resolution if isinstance(field, GridField) else 0.0

    def at(self, halvings: int) -> FieldCamera:
        """Return field and camera for pictures reduced by 2^halvings."""
        camera = self.camera.scaled(0.5**halvings) if halvings else self.camera
        return FieldCamera(self.levels[min(halvings, len(self.levels) - 1)], camera, self.mount)


def observe_reduced(
    image: UInt8[Tensor, "height width 3"],
    view: FieldCamera,
    count: int | None,
    seed: torch.Generator,
    hidden: Hidden | None = None,
) -> Observation:
    """Reduce a picture to the view's camera, at `count` pixels drawn evenly, or at all of them (None); at none that is
    `hidden` in part."""
    camera = view.camera
    colors, every = downsample_image(image, camera), camera.width * camera.height
    if hidden is not None:
        left = torch.nn.functional.adaptive_max_pool2d(hidden[None].float(), (camera.height, camera.width))[0] == 0
        shown = left.reshape(-1).nonzero().squeeze(-1)
        drawn = shown[torch.randperm(len(shown), generator=seed)[:count]]
    elif count is None or count >= every:
        return Observation(view.field, camera, view.mount, camera.pixels(), colors)
    else:
        drawn = torch.randperm(every, generator=seed)[:count]
    pixels = torch.stack([drawn % camera.width, drawn // camera.width], -1)
    return Observation(view.field, camera, view.mount, pixels, colors[drawn])


def reduce_camera(camera: Camera, longest: int = _LONGEST) -> Camera:
    """Return the camera with at most `longest` pixels along its longer edge: a field shows no more."""
    return camera.scaled(min(1.0, longest / max(camera.width, camera.height)))


def resize_picture(image: UInt8[Tensor, "height width 3"], camera: Camera) -> UInt8[Tensor, "h w 3"]:
    """Return a picture with the pixels of another resolution of its camera."""
    if tuple(image.shape[:2]) == (camera.height, camera.width):
        return image
    return (255 * downsample_image(image, camera)).round().to(torch.uint8).reshape(camera.height, camera.width, 3)
