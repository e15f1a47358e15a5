"""Update of the fast filter: descents from coarse to fine, a search where they end in doubt, and the posterior.

One start is not always enough: others are drawn from the prediction, and the most likely ones are kept.
"""


from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

import torch
from torch import Tensor

from nerfnav.core.jit import threads
from nerfnav.estimator.core.belief import Belief
from nerfnav.estimator.core.covariance import POSE
from nerfnav.estimator.core.filter_step import FilterStep
from nerfnav.estimator.gauss_newton.posterior import End, Judge
from nerfnav.estimator.photometric.levenberg_marquardt import POSE as _POSE
from nerfnav.estimator.photometric.levenberg_marquardt import Guess, Iterate, NewtonConfig, improve
from nerfnav.estimator.photometric.pixel_selection import PixelChoice, PixelSource, choose_pixels
from nerfnav.estimator.photometric.pyramid import Stage, observe_reduced
from nerfnav.estimator.photometric.residuals import THREADS, Observation, are_inliers, difference, residuals
from nerfnav.geometry import Pose, so3


def draw_poses(prediction: Belief, count: int, generator: torch.Generator) -> Pose:
    """The mean of a prediction, and random poses of it, batch shape (count + 1,)."""
    mean = prediction.mean
    root = torch.linalg.cholesky(prediction.covariance[POSE][:, POSE])
    draws = torch.randn(count, 6, generator=generator) @ root.T
    draws = torch.cat([torch.zeros(1, 6), draws])
    return Pose(so3.retract(mean.rotation.expand(len(draws), 3, 3), draws[:, 3:]), mean.position + draws[:, :3])


def select_likeliest(seen: Observation, poses: Pose, count: int, saturation: float = 1.0) -> Guess:
    """The first of the poses (n,) and, of the others, those whose view looks most like the picture.

    Colour differences above `saturation` [1 = full scale] count as this.
    """
    off = residuals(seen, poses).abs().clamp_max(saturation).mean((1, 2))
    best = off.argsort()[:count]
    return Guess.at(poses[torch.cat([torch.zeros(1, dtype=best.dtype), best[best != 0]])])


_TYPICAL_DEPTH = 0.3
"""How far off the things are that a picture shows [share of the box's longest edge]."""


@dataclass
class Update(Judge):
    """One update."""

    _chosen: PixelChoice | None = None

    def run(self) -> Iterator[FilterStep]:
        """From coarse to fine; then in rounds from other starts, while that seems to be a false minimum.

        The best so far is kept. A search that its rounds have not ended goes on with the next picture, from the belief
        that is left.
        """
        pyramid, trusted = self.config.pyramid, self.trusted
        many = trusted and self._spread_px() > pyramid.narrow
        best, rival = None, None
        for best in self._descend(pyramid.stages(many), self._coarse_guess() if many else self._only_guess(), 0):
            yield best[0]
        assert best is not None, "a descent yields at least its start"
        iteration, search = best[0].iteration + 1, pyramid.search
        for _ in range(search.rounds if trusted else 0):
            if not self._is_doubtful(best) and self._patches >= search.patches:
                break
            best, rival, iteration = yield from self._search(best, iteration)
        step, seen, here = best
        last = self._conclude(replace(step, iteration=iteration - 1), seen, here)
        yield self._of_both(last, best, rival) if trusted and search.rounds else last

    def _search(self, best: End, iteration: int) -> Generator[FilterStep, None, tuple[End, End | None, int]]:
        """Improve random states of the prediction.

        Returns the best now, another minimum where one was found, and how many iterations there have been.
        """
        search = self.config.pyramid.search
        *early, rival, last = search.stages(self.config.pyramid.pixels)
        guess = self._searched_guess()
        for stage in early:
            found = yield from self._descended(stage, guess, iteration)
            guess, iteration = found[2].likeliest(stage.kept), found[0].iteration + 1
        found = yield from self._descended(rival, Guess.cat([guess, best[2].guess]), iteration)
        guess, iteration = found[2].likeliest(len(found[2].cost)), found[0].iteration + 1
        ends, mine = guess.pose, found[2].guess.pose[-1]
        others = [index for index in range(len(guess.exposure)) if not _alike(ends[index], mine, search.alike)]
        if not others or (others[0] and self._is_doubtful(best)):
            return best, None, iteration
        found = yield from self._descended(last, guess[others[0] : others[0] + 1], iteration)
        first, second = (found, best) if found[2].cost[0] < best[2].cost[0] else (best, found)
        same = _alike(first[2].guess.pose[0], second[2].guess.pose[0], search.alike)
        return first, None if same else second, found[0].iteration + 1

    def _descended(self, stage: Stage, guess: Guess, iteration: int) -> Generator[FilterStep, None, End]:
        """One stage; returns its end."""
        end = None
        for end in self._descend([stage], guess, iteration):
            yield end[0]
        assert end is not None, "a descent yields at least its start"
        return end

    def _descend(self, stages: Sequence[Stage], guess: Guess, iteration: int) -> Iterator[End]:
        """All stages' iterations, with the observation of the stage; the last is the result."""
        pyramid, here = self.config.pyramid, None
        for stage in stages:
            rays = len(guess.exposure) * (stage.iterations + 1)
            pixels = stage.pixels if stage.pixels == pyramid.pixels else min(stage.pixels, pyramid.rays // rays)
            seen, source = self._observation(stage.halvings, guess.pose[0], pixels)
            settled = pyramid.settled * 2**stage.halvings
            settings = NewtonConfig(stage.iterations, robust=stage.robust, settled=settled, stretch=pyramid.stretch)
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
            return observe_reduced(self.image, view, pixels, self.generator), None
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
        return select_likeliest(seen, draw_poses(self.prediction, pyramid.candidates, self.generator), pyramid.starts)

    def _searched_guess(self) -> Guess:
        """The likeliest by the picture at full size."""
        search = self.config.pyramid.search
        seen, _ = self._observation(0, self.prediction.mean.pose, search.pixels[0])
        poses = draw_poses(self.prediction, search.candidates, self.generator)
        return select_likeliest(seen, poses, search.starts, search.saturation)

    def _spread_px(self) -> float:
        """Standard deviation of where things show in the first stage's picture, as far as the prediction can tell."""
        spread = self.prediction.covariance.diagonal()[POSE].sqrt()
        depth = _TYPICAL_DEPTH * float(self.view.levels[0].box.size.max())
        angle = float(spread[3:].norm() + spread[:3].norm() / depth)
        return self.view.at(self.config.pyramid.halvings[0])[1].fx * angle

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


def _alike(first: Pose, second: Pose, bounds: tuple[float, float]) -> bool:
    """Whether two poses are nearer than this: position [m], attitude [rad]."""
    moved = (first.position - second.position).norm()
    return bool(moved < bounds[0]) and bool(so3.local(first.rotation, second.rotation).norm() < bounds[1])
