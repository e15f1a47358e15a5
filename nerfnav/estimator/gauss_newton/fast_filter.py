"""Fast pose filter: the paper's cost (Eq. 6), minimised by Gauss-Newton from coarse to fine.

From a picture to the posterior:

    predict -> select pixels -> align -> test -> search for other minima -> correct

Only the pose T shows in a picture, so J is minimised over T alone, with the prediction's marginal covariance of it.
Velocity and body rate v then follow by their regression on the pose, which is where J is least for that pose:

    v+ = v- + Sigma-_vT (Sigma-_TT)^-1 (T+ (-) T-)

The posterior's information is the prediction's plus that of the picture, with gain and bias of the camera's colours
marginalised.
"""

import dataclasses
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.estimator.core.belief import Belief
from nerfnav.estimator.core.filter_config import FastConfig
from nerfnav.estimator.core.filter_step import FilterUpdate, is_usable, keep_prediction
from nerfnav.estimator.core.prediction import predict
from nerfnav.estimator.gauss_newton.alignment import align, choose_start, image_deviation, search
from nerfnav.estimator.gauss_newton.posterior import Minimum, UpdateProblem, compute_posterior, correct, is_doubtful
from nerfnav.estimator.gauss_newton.secant import descend_secant, measure_information, overstates
from nerfnav.estimator.photometric.pixel_selection import Hidden
from nerfnav.estimator.photometric.pyramid import View
from nerfnav.field import Field, build_levels
from nerfnav.geometry import FORWARD_MOUNT, Camera, Pose, check_image
from nerfnav.robots import ProcessNoise, Robot

MOST_HIDDEN = 0.9
"""Share of a picture beyond which the rest is too little to compare."""


@dataclass(frozen=True)
class FastFilter:
    """Estimator that compares a picture with the field, in milliseconds."""

    field: Field
    """Map."""
    robot: Robot
    """Dynamics of the prediction."""
    camera: Camera
    """Camera of the pictures."""
    mount: Pose = FORWARD_MOUNT
    """T_body_camera."""
    config: FastConfig = dataclasses.field(default_factory=FastConfig)
    """Options."""
    trust_dynamics: bool = True
    """Count the prediction in the cost; False: start from it only, as in dynamically-informed iNeRF."""
    takes_hidden: ClassVar[bool] = True
    """`correct` takes pixels that are not compared."""

    @cached_property
    def view(self) -> View:
        """Field at all levels of sharpness, made once."""
        return View(build_levels(self.field, 1 + max(self.config.pyramid.halvings)), self.camera, self.mount)

    def update(
        self, belief: Belief, image: Tensor | None, action: Float[Tensor, " a"], dt: float, generator: torch.Generator
    ) -> FilterUpdate:
        """Predict over an action of `dt` [s], and correct by the picture (uint8, height x width x 3) taken then.

        Yields a step for each coarse stage and for every iteration of the last; returns the posterior. Raises
        InvalidInputError for a picture of another camera.
        """
        prediction, noise = self.predict(belief, action, dt)
        return self.correct(prediction, image, generator, noise)

    def predict(
        self, belief: Belief, action: Float[Tensor, " a"], dt: float, noise_factor: float = 1.0
    ) -> tuple[Belief, ProcessNoise]:
        """Predict over an action of `dt` [s]; see Predictor."""
        noise = self.config.process_noise.scaled(noise_factor)
        return predict(belief, action, self.robot, dt, noise), noise

    def correct(
        self,
        prediction: Belief,
        image: Tensor | None,
        generator: torch.Generator,
        noise: ProcessNoise | None = None,
        hidden: Hidden | None = None,
    ) -> FilterUpdate:
        """Correct a prediction by a picture, and adapt the size of the process noise that it holds, if given.

        Pixels that are `hidden` show something else than the field: they are not compared, and a picture that hides
        more than MOST_HIDDEN is not used. Yields, returns and raises as `update` does.
        """
        if image is not None:
            check_image(image, self.camera)
        covered = hidden is not None and hidden.float().mean().item() > MOST_HIDDEN
        if covered or not is_usable(image, self.config.least_contrast):
            return keep_prediction(prediction)
        trusted = self.trust_dynamics
        return _correct(UpdateProblem(self.view, self.config, prediction, image, generator, noise, trusted, hidden))


def _correct(problem: UpdateProblem) -> FilterUpdate:
    """Align (which selects the pixels of each stage), test, search, and correct.

    A search whose rounds do not end the doubt goes on with the next picture, from the belief that is left.
    """
    pyramid = problem.config.pyramid
    many = problem.trusted and image_deviation(problem.prediction, problem.view, pyramid.halvings[0]) > pyramid.narrow
    best, rival = (yield from align(problem, pyramid.stages(many), choose_start(problem, many))), None
    if problem.trusted and overstates(problem, best):
        best, rival = descend_secant(problem, best)
        yield best.step
    iteration, rounds = best.step.iteration + 1, pyramid.search.rounds if problem.trusted else 0
    for _ in range(rounds):
        if not is_doubtful(problem, best) and problem.patches >= pyramid.search.patches:
            break
        found = yield from search(problem, best, iteration)
        rival = rival if found.rival is None else _measure(problem, found.rival, best)
        best, iteration = _measure(problem, found.best, best), found.iteration
    best = dataclasses.replace(best, step=dataclasses.replace(best.step, iteration=iteration - 1))
    result = correct(problem, best, rival) if rounds else compute_posterior(problem, best)
    yield result.step
    return result


def _measure(problem: UpdateProblem, minimum: Minimum, measured: Minimum) -> Minimum:
    """Return a minimum with its information, as `measured` is: a second measurement would widen it twice."""
    return minimum if minimum is measured else measure_information(problem, minimum)


def inerf(
    field: Field, robot: Robot, camera: Camera, mount: Pose = FORWARD_MOUNT, config: FastConfig | None = None
) -> FastFilter:
    """Return the baseline, dynamically-informed iNeRF: start at the prediction, and follow the picture alone."""
    return FastFilter(field, robot, camera, mount, FastConfig() if config is None else config, trust_dynamics=False)
