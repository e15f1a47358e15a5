"""Filter of real pictures: the fast filter's posterior (posterior.py), its minimum found by direct image alignment.

The information of the picture at the minimum is measured over the uncertainty where slopes overstate it (secant.py).
"""

import dataclasses
from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor

from nerfnav.estimator.core.belief import Belief
from nerfnav.estimator.core.filter_config import FastConfig
from nerfnav.estimator.core.filter_step import FilterUpdate, is_usable, keep_prediction
from nerfnav.estimator.gauss_newton.alignment import (
    draw_poses,
    image_deviation,
    record,
    select_likeliest,
    start_at_mean,
)
from nerfnav.estimator.gauss_newton.posterior import Minimum, Selection, UpdateProblem, compute_posterior
from nerfnav.estimator.gauss_newton.secant import measure_information
from nerfnav.estimator.photometric.direct_alignment import AlignConfig, fit_pose
from nerfnav.estimator.photometric.levenberg_marquardt import Guess
from nerfnav.estimator.photometric.pixel_selection import PixelSource
from nerfnav.estimator.photometric.pyramid import View, observe_reduced
from nerfnav.field import Field, build_levels
from nerfnav.geometry import FORWARD_MOUNT, Camera, Pose, check_image
from nerfnav.robots import ProcessNoise

_SEARCHED_AT = 2
"""Halvings of the picture on which starts are chosen."""
_SEARCHED_DEVIATION = 2.0 * 2**_SEARCHED_AT
"""Standard deviation of points from where such a start shows them [pixels]."""


@dataclass(frozen=True)
class AlignedFilter:
    """Filter that aligns each picture with a rendering of the field."""

    field: Field
    """Map."""
    camera: Camera
    """Camera of the pictures."""
    mount: Pose = FORWARD_MOUNT
    """T_body_camera."""
    config: FastConfig = dataclasses.field(default_factory=FastConfig)
    """Options of the posterior; pixels and descents are those of `align`."""
    align: AlignConfig = dataclasses.field(default_factory=AlignConfig)
    """Options of the alignment."""

    @property
    def trust_dynamics(self) -> bool:
        """True: the prediction counts in the posterior."""
        return True

    @cached_property
    def view(self) -> View:
        """Field at all levels of sharpness, made once."""
        return View(build_levels(self.field, 1 + _SEARCHED_AT), self.camera, self.mount)

    def correct(
        self,
        prediction: Belief,
        image: Tensor | None,
        generator: torch.Generator,
        noise: ProcessNoise | None = None,
        starts: int = 1,
    ) -> FilterUpdate:
        """Correct a prediction, which holds this process noise, by a picture.

        With several `starts`, the likeliest of random states of the prediction are followed. Raises InvalidInputError
        for a picture of another camera.
        """
        if image is not None:
            check_image(image, self.camera)
        if not is_usable(image, self.config.least_contrast):
            return keep_prediction(prediction)
        return _correct(UpdateProblem(self.view, self.config, prediction, image, generator, noise), self.align, starts)


def _correct(problem: UpdateProblem, config: AlignConfig, starts: int) -> FilterUpdate:
    """Align from each start, and correct by the minimum of least cost."""
    if starts > 1:
        guess, deviation = _choose_starts(problem, starts), _SEARCHED_DEVIATION
    else:
        guess, deviation = start_at_mean(problem).guess, image_deviation(problem.prediction, problem.view)
    ends = [_align(problem, guess[index : index + 1], deviation, config) for index in range(len(guess.exposure))]
    best = min(ends, key=lambda end: float(end.iterate.cost[0]))
    result = compute_posterior(problem, measure_information(problem, best))
    yield result.step
    return result


def _align(problem: UpdateProblem, guess: Guess, deviation: float, config: AlignConfig) -> Minimum:
    """Return the end of an alignment; points may be `deviation` [pixels] from where the guess shows them."""
    here, seen = fit_pose(problem.image, problem.view, guess, deviation, problem.prior, config, problem.generator)
    selection = Selection(seen, seen.pixels, PixelSource.UNIFORM)
    return Minimum(record(problem, here, selection, iteration=0), selection, here)


def _choose_starts(problem: UpdateProblem, starts: int) -> Guess:
    """Return the likeliest random states of the prediction, by a small picture."""
    pyramid = problem.config.pyramid
    seen = observe_reduced(problem.image, problem.view.at(_SEARCHED_AT), pyramid.glance, problem.generator)
    return select_likeliest(seen, draw_poses(problem.prediction, pyramid.candidates, problem.generator), starts)
