"""One update of the fast filter: descents from coarse to fine, a search where they end in doubt, and the posterior."""

from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.compiled import threads
from nerfnav.estimator.adaptive import noise_scale, with_noise_scaled
from nerfnav.estimator.belief import Belief
from nerfnav.estimator.cost import PoseCost, precision
from nerfnav.estimator.covariance import POSE, information_of, posterior_covariance
from nerfnav.estimator.descents import improve
from nerfnav.estimator.filter import FilterConfig
from nerfnav.estimator.newton import POSE as _POSE
from nerfnav.estimator.newton import Guess, Iterate, NewtonConfig, Prior, joined, picture_information
from nerfnav.estimator.noise import ProcessNoise
from nerfnav.estimator.photometric import THREADS, Observation, are_inliers, difference, patches
from nerfnav.estimator.pixels import PixelChoice, PixelSource, choose_pixels
from nerfnav.estimator.pyramid import Stage, View, small_observation
from nerfnav.estimator.starts import drawn, likeliest
from nerfnav.estimator.steps import FilterOutcome, FilterStep
from nerfnav.geometry import Pose, so3
from nerfnav.robots import BODY_RATE, TANGENT, VELOCITY, RigidState

_End = tuple[FilterStep, Observation, Iterate]
"""Where a descent is."""
_TOLD = 3
"""Fewest directions of the six in which a picture must halve the variance to be more than WEAK."""
_TYPICAL_DEPTH = 0.3
"""How far off the things are that a picture shows [share of the box's longest edge]."""


@dataclass
class Update:
    """One update."""

    view: View
    """What looks at what."""
    config: FilterConfig
    """How it works."""
    trusted: bool
    """Whether the prediction counts in the cost."""
    prediction: Belief
    """Where the dynamics lead, with the process noise `noise` in it."""
    image: Tensor
    generator: torch.Generator
    noise: ProcessNoise | None = None
    _chosen: PixelChoice | None = None

    def run(self) -> Iterator[FilterStep]:
        """From coarse to fine; then in rounds from other starts, while that seems to be a false minimum.

        The best so far is kept. A search that its rounds have not ended goes on with the next picture, from the belief
        that is left.
        """
        pyramid, trusted = self.config.pyramid, self.trusted
        many = trusted and self._spread_px() > pyramid.narrow
        best = None
        for best in self._descend(pyramid.stages(many), self._coarse_guess() if many else self._only_guess(), 0):
            yield best[0]
        assert best is not None, "a descent yields at least its start"
        iteration, search = best[0].iteration + 1, pyramid.search
        for _ in range(search.rounds if trusted else 0):
            if not self._is_doubtful(best):
                break
            best, iteration = yield from self._search(best, iteration)
        step, seen, here = best
        yield self._conclude(replace(step, iteration=iteration - 1), seen, here)

    def _search(self, best: _End, iteration: int) -> Generator[FilterStep, None, tuple[_End, int]]:
        """Improve random states of the prediction; returns the best now, and how many iterations there have been."""
        search = self.config.pyramid.search
        *early, rival, last = search.stages(self.config.pyramid.pixels)
        guess = self._searched_guess()
        for stage in early:
            found = yield from self._descended(stage, guess, iteration)
            guess, iteration = found[2].likeliest(stage.kept), found[0].iteration + 1
        found = yield from self._descended(rival, Guess.cat([guess, best[2].guess]), iteration)
        guess, iteration = found[2].likeliest(rival.kept), found[0].iteration + 1
        if _alike(guess.pose[0], found[2].guess.pose[-1], search.alike):
            return best, iteration
        found = yield from self._descended(last, guess, iteration)
        return found if found[2].cost[0] < best[2].cost[0] else best, found[0].iteration + 1

    def _descended(self, stage: Stage, guess: Guess, iteration: int) -> Generator[FilterStep, None, _End]:
        """One stage; returns its end."""
        end = None
        for end in self._descend([stage], guess, iteration):
            yield end[0]
        assert end is not None, "a descent yields at least its start"
        return end

    def _descend(self, stages: Sequence[Stage], guess: Guess, iteration: int) -> Iterator[_End]:
        """All stages' iterations, with the observation of the stage; the last is the result."""
        pyramid, here = self.config.pyramid, None
        for stage in stages:
            rays = len(guess.exposure) * (stage.iterations + 1)
            pixels = stage.pixels if stage.pixels == pyramid.pixels else min(stage.pixels, pyramid.rays // rays)
            seen, source = self._observation(stage.halvings, guess.pose[0], pixels)
            settled = pyramid.settled * 2**stage.halvings
            settings = NewtonConfig(stage.iterations, robust=stage.robust, settled=settled)
            places = ((seen.pixels + 0.5) * 2**stage.halvings).long()
            prior = self._prior(len(seen.pixels), stage.halvings)
            for here in improve(seen, guess, prior, settings, stage.told):
                yield self._record(iteration, here, int(here.cost.argmin()), (places, source)), seen, here
                iteration += 1
            assert here is not None, "a descent has at least its start"
            guess = here.likeliest(stage.kept)

    def _observation(self, halvings: int, pose: Pose, pixels: int) -> tuple[Observation, PixelSource | None]:
        """So many pixels of one stage, which begins at a pose."""
        view, pyramid = self.view.at(halvings), self.config.pyramid
        if halvings:
            return small_observation(self.image, view, pixels, self.generator), None
        if self._chosen is None:
            wanted = replace(self.config.pixels, count=pyramid.pixels, draw=pyramid.draw)
            slopes = partial(Observation.slopes, pose, view)
            with threads(THREADS):
                self._chosen = choose_pixels(self.image, wanted, self.generator, slopes)
        chosen = self._chosen.pixels
        if pixels < len(chosen):
            chosen = chosen[torch.randperm(len(chosen), generator=self.generator)[:pixels]]
        return Observation.of(self.image, chosen, view), self._chosen.source

    def _only_guess(self) -> Guess:
        """The mean of the prediction."""
        return Guess.at(self.prediction.mean.pose.map(lambda tensor: tensor[None]))

    def _coarse_guess(self) -> Guess:
        """The likeliest by the smallest picture."""
        pyramid = self.config.pyramid
        seen, _ = self._observation(pyramid.halvings[0], self.prediction.mean.pose, pyramid.glance)
        return likeliest(seen, drawn(self.prediction, pyramid.candidates, self.generator), pyramid.starts)

    def _searched_guess(self) -> Guess:
        """The likeliest by the picture at full size."""
        search = self.config.pyramid.search
        seen, _ = self._observation(0, self.prediction.mean.pose, search.pixels[0])
        poses = drawn(self.prediction, search.candidates, self.generator)
        return likeliest(seen, poses, search.starts, search.saturation)

    def _prior(self, pixels: int, halvings: int = 0) -> Prior:
        config, noise = self.config, self.config.color_noise
        kappa = config.pyramid.mistrust**-halvings / (self._alike(pixels) * noise.std**2)
        slack = config.pyramid.misplaced * self.view.grain / noise.std
        return Prior(self._information, self.prediction.mean.pose, kappa, slack)

    @cached_property
    def _information(self) -> Float[Tensor, "8 8"]:
        """Of the pose and of the exposure."""
        return joined(self._known if self.trusted else None, (self.config.gain_std, self.config.bias_std))

    @cached_property
    def _known(self) -> Float[Tensor, "6 6"]:
        """Inverse covariance of the predicted pose."""
        return precision(self.prediction.covariance[POSE][:, POSE])

    def _alike(self, pixels: int) -> float:  # k: how many of this many pixels err alike
        return self.config.color_noise.alike_of(pixels, self._patches)

    @cached_property
    def _patches(self) -> float:
        return patches(self.image, noise_std=self.config.color_noise.std)

    def _spread_px(self) -> float:
        """Standard deviation of where things show in the first stage's picture, as far as the prediction can tell."""
        spread = self.prediction.covariance.diagonal()[POSE].sqrt()
        depth = _TYPICAL_DEPTH * float(self.view.levels[0].box.size.max())
        angle = float(spread[3:].norm() + spread[:3].norm() / depth)
        return self.view.at(self.config.pyramid.halvings[0])[1].fx * angle

    @cached_property
    def _regression(self) -> Float[Tensor, "12 6"]:
        """Change of the whole state for a change of the pose; of the pose alone where the dynamics are not trusted."""
        if not self.trusted:
            return torch.eye(TANGENT)[:, POSE]
        covariance = self.prediction.covariance
        return torch.linalg.solve(covariance[POSE][:, POSE], covariance[POSE]).T

    def _state(self, pose: Pose, change: Float[Tensor, "6"]) -> RigidState:
        """The whole state for a pose, which is `change` away from the prediction."""
        mean, change = self.prediction.mean, self._regression @ change
        velocity, body_rate = mean.velocity + change[VELOCITY], mean.body_rate + change[BODY_RATE]
        return RigidState(pose.position, velocity, pose.rotation, body_rate)

    def _record(
        self, iteration: int, here: Iterate, best: int, looked: tuple[Tensor, PixelSource | None]
    ) -> FilterStep:
        residual, pose, (pixels, source) = here.residual[best], here.guess.pose, looked
        size = difference(residual)
        return FilterStep(
            iteration,
            self._state(Pose(pose.rotation[best], pose.position[best]), here.change[best, _POSE]),
            float(here.cost[best] - here.process[best]),
            float(here.process[best]),
            pixels,
            size,
            believed=are_inliers(size, self.config.color_noise),
            pixel_source=source,
        )

    def _is_doubtful(self, end: _End) -> bool:
        """Whether the colours differ by more than noise explains, on the whole or mostly."""
        step, seen, _ = end
        bound = self.config.pyramid.search.doubt * self.config.color_noise.std
        return not self._squares(step, seen) <= bound**2 or self._disagrees(step)

    def _squares(self, step: FilterStep, seen: Observation) -> float:
        """Mean square of the colours' differences (Huber)."""
        return step.photometric / self._prior(len(seen.pixels)).kappa / step.residual.numel() / 3

    def _disagrees(self, step: FilterStep) -> bool:
        """Whether most pixels differ by more than noise explains."""
        config = self.config
        return not step.residual.median().item() <= config.residual_gate * config.color_noise.std

    @torch.no_grad()
    def _conclude(self, step: FilterStep, seen: Observation, here: Iterate) -> FilterStep:
        """The posterior at the minimum, or the prediction where the minimum is not to be believed."""
        config = self.config
        known = picture_information(here)
        if not step.process <= config.innovation_gate or self._disagrees(step) or not known.isfinite().all():
            return replace(step, posterior=self.prediction, outcome=FilterOutcome.DIVERGED)
        scale, change = self._doubt_of(step, seen), here.change[0, _POSE]
        known = known / scale
        step, prediction = self._adapted(step, change, known)
        if config.exact_covariance:
            noise = replace(config.color_noise, alike=scale * self._alike(len(seen.pixels)))
            curved = PoseCost.of(seen.exposed(here.guess.exposure[0]), prediction, noise).hessian(step.mean)
        else:
            curved = 2 * information_of(change[3:], precision(prediction.covariance), known)
        covariance, curvature = posterior_covariance(curved, prediction.covariance)
        floor = replace(config.floor, position_m=max(config.floor.position_m, config.grain * self.view.grain))
        covariance = covariance + floor.covariance()
        root = torch.linalg.cholesky(prediction.covariance[POSE][:, POSE])
        gained = torch.linalg.eigvalsh(root.T @ known @ root) > 1
        outcome = FilterOutcome.UPDATED if int(gained.sum()) >= _TOLD else FilterOutcome.WEAK
        mean = replace(step.mean, rotation=so3.project(step.mean.rotation))
        return replace(step, mean=mean, posterior=Belief(mean, covariance), outcome=outcome, curvature=curvature)

    def _doubt_of(self, step: FilterStep, seen: Observation) -> float:
        """How many times less a picture tells than held-out views promise, by its own differences and its patches."""
        if not self.config.adaptive:
            return 1.0
        return self.config.color_noise.doubt(self._squares(step, seen), self._patches)

    def _adapted(
        self, step: FilterStep, change: Float[Tensor, "6"], known: Float[Tensor, "6 6"]
    ) -> tuple[FilterStep, Belief]:
        """The end of a descent and the prediction, as they are with the process noise that the picture shows.

        The pose stays, for the prediction hardly moves it; its velocities follow.
        """
        config, before = self.config, self.prediction
        if self.noise is None or not self.trusted or not config.adaptive:
            return step, before
        size = noise_scale(change, self._known, known, config.noise_trust)
        adapted = replace(self, prediction=with_noise_scaled(before, self.noise.covariance(), size))
        return replace(step, mean=adapted._state(step.mean.pose, change)), adapted.prediction


def _alike(first: Pose, second: Pose, bounds: tuple[float, float]) -> bool:
    """Whether two poses are nearer than this: position [m], attitude [rad]."""
    moved = (first.position - second.position).norm()
    return bool(moved < bounds[0]) and bool(so3.local(first.rotation, second.rotation).norm() < bounds[1])
