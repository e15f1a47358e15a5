"""Fast pose filter: the paper's cost (Eq. 6), minimised by Gauss-Newton from coarse to fine.

Only the pose T shows in a picture, so J is minimised over T alone, with the prediction's marginal covariance of it.
Velocity and body rate v then follow by their regression on the pose, which is where J is least for that pose:

    v+ = v- + Sigma-_vT (Sigma-_TT)^-1 (T+ (-) T-)

The posterior's information is the prediction's plus that of the picture, with gain and bias of the camera's colours
marginalised.
"""

import dataclasses
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.estimator.core.belief import Belief
from nerfnav.estimator.core.filter_step import FilterStep, measure_contrast, predicted_only
from nerfnav.estimator.core.prediction import predict
from nerfnav.estimator.gauss_newton.update import Update
from nerfnav.estimator.paper.pose_filter import FilterConfig
from nerfnav.estimator.photometric.pyramid import View
from nerfnav.field import Field, build_levels
from nerfnav.geometry import FORWARD_MOUNT, Camera, Pose, check_image
from nerfnav.robots import ProcessNoise, Robot


@dataclass(frozen=True)
class FastFilter:
    """An estimator that compares a picture with what the field shows, in milliseconds."""

    field: Field
    """The map."""
    robot: Robot
    """Its dynamics predict."""
    camera: Camera
    """What takes the pictures."""
    mount: Pose = FORWARD_MOUNT
    """T_body_camera."""
    config: FilterConfig = dataclasses.field(default_factory=FilterConfig)
    """How it works."""
    trust_dynamics: bool = True
    """Whether the prediction counts in the cost; False: it is the start only, as in dynamically-informed iNeRF."""

    @cached_property
    def view(self) -> View:
        """What looks at what, at all levels: made once."""
        return View(build_levels(self.field, 1 + max(self.config.pyramid.halvings)), self.camera, self.mount)

    def update(
        self, belief: Belief, image: Tensor | None, action: Float[Tensor, " a"], dt: float, generator: torch.Generator
    ) -> Iterator[FilterStep]:
        """The belief after an action of `dt` [s] and the picture (uint8, height x width x 3) taken then, if any.

        Yields a step for each coarse stage and for every iteration of the last; the very last step carries the
        posterior and the outcome. Raises InvalidInputError where the picture is not one of this camera.
        """
        noise = self.config.process_noise
        return self.correct(predict(belief, action, self.robot, dt, noise), image, generator, noise)

    def correct(
        self, prediction: Belief, image: Tensor | None, generator: torch.Generator, noise: ProcessNoise | None = None
    ) -> Iterator[FilterStep]:
        """The same for a belief that the dynamics have moved already, and have added this `noise` to.

        Where that is told, its size is adapted to what the picture shows. Raises as `update` does.
        """
        if image is not None:
            check_image(image, self.camera)
        if image is None or measure_contrast(image) < self.config.least_contrast:
            return iter([predicted_only(prediction)])
        return Update(self.view, self.config, self.trust_dynamics, prediction, image, generator, noise).run()


def inerf(
    field: Field, robot: Robot, camera: Camera, mount: Pose = FORWARD_MOUNT, config: FilterConfig | None = None
) -> FastFilter:
    """The baseline: dynamically-informed iNeRF, which starts where the dynamics lead and follows the picture alone."""
    return FastFilter(field, robot, camera, mount, FilterConfig() if config is None else config, trust_dynamics=False)
