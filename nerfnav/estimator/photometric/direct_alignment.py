"""Direct image alignment: move the picture over a rendering of the field, without rendering again at every step.

From a pose near the camera's, pixels are rendered once, each with its colour C_i and the point X_i at its mean depth.
With pi the projection of a point, and I the picture, all later steps compare

    r_i(T) = (1 + g) C_i + b - I(pi(T^-1 X_i))

(Lucas and Kanade 1981; of dense maps: Newcombe, Lovegrove, Davison, "DTAM", 2011, Sec. 2.3). The slopes are the
picture's, which is smooth where a field is rough: between sharp nodes that a few pictures taught, J has many small
minima, and where Gauss-Newton's steps on the field itself end depends on where they began. It costs a
rendering of the pixels or two, where descents make ten.

The picture is blurred, first by about the standard deviation of the prediction, then less and less, to no less than the
sharpness of the field; after each blur, pixels are rendered again from the pose that was found. A descent on the field
itself follows: in fog, the mean depth means nothing.

A lens is linear about each pixel: du = L_i d(x / z, y / z), exact where a step ends.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np
import torch
from jaxtyping import Float, Int, UInt8
from torch import Tensor

from nerfnav.core.jit import threads
from nerfnav.estimator.photometric.kernels.direct_alignment import align
from nerfnav.estimator.photometric.levenberg_marquardt import UNKNOWNS, Guess, Iterate, NewtonConfig, Prior, improve
from nerfnav.estimator.photometric.pyramid import View
from nerfnav.estimator.photometric.residuals import THREADS, Observation
from nerfnav.field import FastRenderer, Rendering, probe_rays, render_rays
from nerfnav.geometry import Camera, Pose

_FAR = 1e3
"""Pixels in which nothing shows are as far away as this [longest edges of the box]: only turns move them."""
_FINE = 3.0
"""Blurs of twice this and more are made on smaller pictures, where they are no less than this [pixels]."""


@dataclass(frozen=True)
class AlignConfig:
    """Options of direct image alignment."""

    pixels: int = 384
    """Pixels compared in each round ..."""
    last_pixels: int = 448
    """... and in the descent on the field itself that follows."""
    last_iterations: int = 2
    """Steps of that, at most."""
    last_settled: float = 3e-4
    """It ends with a step shorter than this [longest edges of the box]."""
    iterations: int = 6
    """Steps of each round, at most."""
    robust: float = 0.1
    """Colour difference beyond which a pixel pulls less and less (Huber) [1 = full scale]."""
    damping: float = 1e-3
    """First lambda, relative to the diagonal of the curvature."""
    settled: float = 0.1
    """A round ends before a step shorter than this [standard deviations of what is found]."""
    grain: float = 0.33
    """The last blur, as a share of the distance of the field's nodes in the picture ..."""
    blur: tuple[float, float] = (0.7, 2.0)
    """... and within these bounds [pixels]."""
    widest: float = 16.0
    """The first one, at most [pixels]."""
    shrink: float = 3.0
    """Each blur is so many times the next one."""


PriorOf = Callable[[int], Prior]
"""Prior of a comparison of so many pixels."""


def fit_pose(
    image: UInt8[Tensor, "height width 3"],
    view: View,
    guess: Guess,
    deviation: float,
    prior: PriorOf,
    config: AlignConfig,
    generator: torch.Generator,
) -> tuple[Iterate, Observation]:
    """Align a picture, then descend on the field itself; returns the end (1,) and the pixels of that descent.

    `deviation` is the standard deviation of points from where the first guess (1,) shows them [pixels].
    """
    guess = align_picture(image, view, guess, deviation, prior, config, generator)
    seen = Observation.of(image, draw_spaced_pixels(view.camera, config.last_pixels, generator), view.at(0))
    settled = config.last_settled * float(seen.field.box.size.max())
    newton = NewtonConfig(config.last_iterations, robust=config.robust, settled=settled)
    *_, here = improve(seen, guess, prior(len(seen.pixels)), newton, every=False)
    return here, seen


def align_picture(
    image: UInt8[Tensor, "height width 3"],
    view: View,
    guess: Guess,
    deviation: float,
    prior: PriorOf,
    config: AlignConfig,
    generator: torch.Generator,
) -> Guess:
    """Align a picture in rounds of ever less blur, from half the `deviation` on; returns the last guess (1,)."""
    colors = image.numpy().astype(np.float32) / 255
    blurs = None
    while blurs is None or blurs:
        pixels = draw_spaced_pixels(view.camera, config.pixels, generator)
        seen = Observation.of(image, pixels, view.at(0))
        scene, depth = _scene(seen, guess.pose[0])
        if blurs is None:
            blurs = _blurs(0.5 * deviation, config.grain * view.grain * view.camera.fx / depth, config)
        guess = _round((blur_picture(colors, blurs[0]), *scene), guess, prior(len(pixels)), config)
        blurs = blurs[1:]
    return guess


def blur_picture(colors: np.ndarray, blur: float) -> np.ndarray:
    """Blur a picture (height, width, 3) by a Gaussian of a standard deviation [pixels].

    Wide ones are made on a picture that is s times smaller, a tenth of the time: a mean over s pixels has the variance
    (s^2 - 1) / 12, and to interpolate between them adds s^2 / 6.
    """
    height, width, _ = colors.shape
    smaller = 2 ** max(0, math.floor(math.log2(blur / _FINE)))
    if smaller == 1 or min(height, width) < smaller:
        return cv2.GaussianBlur(colors, (0, 0), blur)
    left = blur**2 - (smaller**2 - 1) / 12 - smaller**2 / 6
    small = cv2.resize(colors, (width // smaller, height // smaller), interpolation=cv2.INTER_AREA)
    small = cv2.GaussianBlur(small, (0, 0), math.sqrt(left) / smaller)
    return cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR)


def _blurs(first: float, grain: float, config: AlignConfig) -> list[float]:
    """Return the blur of each round [pixels]; `grain` is a share of the distance of nodes in the picture."""
    last = min(max(grain, config.blur[0]), config.blur[1])
    first = min(max(first, last), config.widest)
    count = max(1, round(math.log(first / last) / math.log(config.shrink)))
    return [max(last, first / config.shrink**index) for index in range(count)]


def draw_spaced_pixels(camera: Camera, count: int, generator: torch.Generator) -> Int[Tensor, "m 2"]:
    """Draw about so many pixels, one anywhere in each cell of a grid (jittered sampling)."""
    across = max(1, round((count * camera.width / camera.height) ** 0.5))
    down = max(1, count // across)
    cells = torch.stack(torch.meshgrid(torch.arange(across), torch.arange(down), indexing="xy"), -1).reshape(-1, 2)
    at = (cells + torch.rand(len(cells), 2, generator=generator)) / torch.tensor([across, down])
    size = torch.tensor([camera.width, camera.height])
    return torch.minimum((at * size).long(), size - 1)


def _scene(seen: Observation, pose: Pose) -> tuple[tuple[np.ndarray, ...], float]:
    """Return the arguments of the kernel `align`, and the median depth [m]."""
    origins, directions = seen.camera.rays(pose.compose(seen.mount), seen.pixels)
    shown = _rendered(seen, origins.contiguous(), directions.contiguous())
    depth = torch.where(shown.opacity > 0.5, shown.depth, _FAR * float(seen.field.box.size.max()))
    points = origins.double() + depth.double()[:, None] * directions.double()
    flat, lens = _lens(seen.camera, seen.pixels)
    parts = (points, shown.color.float(), seen.pixels.double() + 0.5, flat, lens, seen.mount.rotation.double(),
             seen.mount.position.double())  # fmt: skip
    return tuple(np.ascontiguousarray(part.numpy()) for part in parts), float(depth.median())


def _rendered(seen: Observation, origins: Tensor, directions: Tensor) -> Rendering:
    with torch.no_grad(), threads(THREADS):
        if (probed := probe_rays(seen.field, origins, directions)) is not None:
            return probed
        if isinstance(seen.field, FastRenderer):
            return seen.field.render_rays(origins, directions)
        return render_rays(seen.field, origins, directions)


def _lens(camera: Camera, pixels: Int[Tensor, "m 2"]) -> tuple[Float[Tensor, "m 2"], Float[Tensor, "m 2 2"]]:
    """Return x / z and y / z of pixels, y downwards, and the derivative of pixels by these."""
    if not camera.distortion:
        flat = (pixels.double() + 0.5 - torch.tensor([camera.cx, camera.cy])) / torch.tensor([camera.fx, camera.fy])
        return flat, torch.diag(torch.tensor([camera.fx, camera.fy], dtype=torch.float64)).expand(len(pixels), 2, 2)
    beside = torch.tensor([[0, 0], [1, 0], [-1, 0], [0, 1], [0, -1]])
    ways = camera.directions(pixels + beside[:, None]).double()
    flat = torch.stack([ways[..., 0], -ways[..., 1]], -1) / -ways[..., 2:]
    slopes = torch.stack([flat[1] - flat[2], flat[3] - flat[4]], -1) / 2
    return flat[0], torch.linalg.inv(slopes)


def _round(scene: tuple[np.ndarray, ...], guess: Guess, prior: Prior, config: AlignConfig) -> Guess:
    """Return the end of one round."""
    square = (UNKNOWNS, UNKNOWNS)
    shapes = ((3, 3), (3,), (2,), (), (), (len(scene[1]), 3), (UNKNOWNS,), square, square, (UNKNOWNS,))
    state = tuple(np.zeros((2, *shape)) for shape in shapes)
    for part, begin in zip(state, (guess.pose.rotation, guess.pose.position, guess.exposure), strict=False):
        part[0] = begin[0].double().numpy()
    known = prior.arguments()[:-1]  # without the slack: the slopes are the picture's
    held = align(scene, known, (config.iterations, config.damping, config.robust, config.settled), state)
    rotation, position, exposure = (torch.from_numpy(part[held]).float()[None] for part in state[:3])
    return Guess(Pose(rotation, position), exposure)
