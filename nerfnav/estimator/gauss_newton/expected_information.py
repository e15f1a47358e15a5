"""Expected information: what a picture from a pose will tell of it, by the field alone and before it is taken.

The field renders the picture that it expects. Its pixels are chosen and weighed as the filter does it, and tell what
their colours change by over the covariance Sigma of the pose, not what slopes at a point promise
(photometric/secant.py):

    Sigma = (Sigma-^-1 + H)^-1,   H by secants over Sigma, gain and bias of the camera's colours marginalised

H needs Sigma, the posterior: a fixed point.
"""

from dataclasses import replace
from functools import partial

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.estimator.core.filter_config import FastConfig
from nerfnav.estimator.core.filter_step import is_usable
from nerfnav.estimator.paper.cost import precision
from nerfnav.estimator.photometric.levenberg_marquardt import POSE, Guess, join_information
from nerfnav.estimator.photometric.pixel_selection import choose_pixels
from nerfnav.estimator.photometric.pyramid import View, reduce_camera
from nerfnav.estimator.photometric.residuals import Observation, count_patches, residuals
from nerfnav.estimator.photometric.secant import invert, settle_information
from nerfnav.geometry import Pose

_LONGEST, _PIXELS = 64, 192
"""Longer edge of the expected picture, and its pixels that stand for those of the filter: medians of sigma along plans
are within a tenth of those by 100 and 512, in a quarter of the time."""
_ROUNDS = 3
"""Rounds of the fixed point, which begins at the prediction."""


@torch.no_grad()
def expected_information(
    view: View, pose: Pose, covariance: Float[Tensor, "6 6"], config: FastConfig, generator: torch.Generator
) -> Float[Tensor, "6 6"]:
    """Return H in the tangent of the body's pose: position [1/m^2] and attitude [1/rad^2].

    `covariance` is Sigma-, that of the predicted pose. H is 0 where the picture has too little contrast to be used.
    """
    camera = reduce_camera(view.camera, _LONGEST)
    small = replace(view, camera=camera).at(0)
    every = Observation(small.field, camera, view.mount, camera.pixels(), torch.zeros(camera.width * camera.height, 3))
    colors = residuals(every, pose[None])[0].reshape(camera.height, camera.width, 3).clamp(0, 1)
    image = (255 * colors).round().to(torch.uint8)
    if not is_usable(image, config.least_contrast):
        return torch.zeros_like(covariance)
    wanted = replace(config.pixels, count=_PIXELS, draw=config.pyramid.draw)
    pixels = choose_pixels(image, wanted, generator, partial(Observation.slopes, pose, small)).pixels
    seen = replace(every, pixels=pixels, colors=colors[pixels[:, 1], pixels[:, 0]])

    noise, compared = config.color_noise, config.pyramid.pixels
    patches = count_patches(image, noise_std=noise.usual_std(view.levels[0]))
    alike = noise.alike_of(compared, patches) * noise.doubt(noise.std**2, patches) * len(pixels) / compared
    known = join_information(precision(covariance), (config.gain_std, config.bias_std))
    robust, guess, over = config.pyramid.robust[-1], Guess.at(pose[None]), invert(known[POSE, POSE].double())
    return settle_information(seen, guess, over, known, noise.std, alike, robust, _ROUNDS).to(covariance)
