"""Filter of real pictures: the fast filter's posterior (update.py), its minimum found by direct alignment."""

import dataclasses
from dataclasses import dataclass
from functools import cached_property

import torch
from torch import Tensor

from nerfnav.estimator.core.belief import Belief
from nerfnav.estimator.core.covariance import POSE
from nerfnav.estimator.core.filter_step import FilterStep, measure_contrast, predicted_only
from nerfnav.estimator.gauss_newton.update import Update, draw_poses, select_likeliest
from nerfnav.estimator.paper.pose_filter import FilterConfig
from nerfnav.estimator.photometric.direct_alignment import AlignConfig, fit_pose
from nerfnav.estimator.photometric.levenberg_marquardt import Guess, Iterate
from nerfnav.estimator.photometric.pixel_selection import PixelSource
from nerfnav.estimator.photometric.pyramid import View, observe_reduced
from nerfnav.estimator.photometric.residuals import Observation
from nerfnav.field import Field, build_levels
from nerfnav.geometry import FORWARD_MOUNT, Camera, Pose, check_image
from nerfnav.robots import ProcessNoise

_TYPICAL_DEPTH = 0.3
"""How far off the things are that a picture shows [share of the box's longest edge]."""
_SEARCHED_AT = 2
"""Starts are chosen on a picture halved so many times."""


@dataclass(frozen=True)
class AlignedFilter:
    """A filter that lays each picture over what the field shows."""

    field: Field
    """The map."""
    camera: Camera
    """What takes the pictures."""
    mount: Pose = FORWARD_MOUNT
    """T_body_camera."""
    config: FilterConfig = dataclasses.field(default_factory=FilterConfig)
    """What the posterior is made of; pixels and descents are those of `align`."""
    align: AlignConfig = dataclasses.field(default_factory=AlignConfig)
    """How pictures are aligned."""

    @cached_property
    def view(self) -> View:
        """What looks at what, at all levels: made once."""
        return View(build_levels(self.field, 1 + _SEARCHED_AT), self.camera, self.mount)

    def correct(
        self, prediction: Belief, image: Tensor, generator: torch.Generator, noise: ProcessNoise, starts: int = 1
    ) -> FilterStep:
        """The belief with what a picture shows; `prediction` holds this process noise.

        With several `starts`, the likeliest of random states of the prediction are followed. Raises InvalidInputError
        where the picture is not one of this camera.
        """
        check_image(image, self.camera)
        if measure_contrast(image) < self.config.least_contrast:
            return predicted_only(prediction)
        update = _Aligned(self.view, self.config, True, prediction, image, generator, noise)
        return update.aligned(self.align, starts)


class _Aligned(Update):
    """One update."""

    def aligned(self, config: AlignConfig, starts: int) -> FilterStep:
        """The posterior, from the likeliest of so many starts."""
        if starts > 1:
            guess, spread = self._from_around(starts), 2.0 * 2**_SEARCHED_AT
        else:
            guess, spread = self._only_guess(), self._spread()
        ends = [self._end(guess[index : index + 1], spread, config) for index in range(len(guess.exposure))]
        return self._conclude(*min(ends, key=lambda end: float(end[2].cost[0])))

    def _end(self, guess: Guess, spread: float, config: AlignConfig) -> tuple[FilterStep, Observation, Iterate]:
        """Where one start leads; things may be `spread` [pixels] from where it shows them."""
        here, seen = fit_pose(self.image, self.view, (guess, spread), self._prior, (config, self.generator))
        return self._record(0, here, 0, (seen.pixels, PixelSource.UNIFORM)), seen, here

    def _spread(self) -> float:
        """Standard deviation of where things show, as far as the prediction can tell [pixels]."""
        spread = self.prediction.covariance.diagonal()[POSE].sqrt()
        depth = _TYPICAL_DEPTH * float(self.view.levels[0].box.size.max())
        return self.view.camera.fx * float(spread[3:].norm() + spread[:3].norm() / depth)

    def _from_around(self, starts: int) -> Guess:
        """The likeliest random states of the prediction, by a small picture."""
        pyramid = self.config.pyramid
        seen = observe_reduced(self.image, self.view.at(_SEARCHED_AT), pyramid.glance, self.generator)
        return select_likeliest(seen, draw_poses(self.prediction, pyramid.candidates, self.generator), starts)
