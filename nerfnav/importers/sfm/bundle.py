"""Bundle adjustment: poses, points and a lens that explain best where frames show points.

Levenberg and Marquardt's method with Huber's loss. With the Jacobians A of residuals r by cameras and lens, and B by
points, each step solves the normal equations

    [U  W] [a]     [A' r]
    [W' V] [b] = - [B' r],    U = A' A, W = A' B, V = B' B with a block of 3 x 3 for each point,

for the cameras first (Schur complement; Triggs et al., "Bundle adjustment - a modern synthesis", 1999):
(U - W V^-1 W') a = -A' r + W V^-1 B' r, then b = V^-1 (-B' r - W' a).
"""

from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.linalg import cho_factor, cho_solve
from scipy.spatial.transform import Rotation

from nerfnav.core.jit import kernel
from nerfnav.importers.sfm.model import Model, Observations, SharedLens, sum_matrices

_LOSS = 1.0
"""Distance from which the loss grows linearly [pixels]."""
_PRIOR = np.array([0.5, 0.2, 0.2])
"""Standard deviations of the logarithm of the focal length, k1 and k2: what pictures do not tell stays as it is."""
_ENOUGH = 1e-4
"""Relative decrease of the cost at which the descent ends."""
_DAMPING, _LEAST_DAMPING, _MOST_DAMPING, _FACTOR = 1e-4, 1e-8, 1e6, 8.0
"""First, smallest (it alone keeps place, heading and scale of the world) and largest damping; factor of a change."""
_STRETCH = 0.3
"""Largest change of the logarithm of the focal length in a step."""
_BEHIND, _BEHIND_COST = 1e-6, 1e6
"""Depth below which a point is behind a camera, and what that costs: no step may bring one there."""


def adjust(
    model: Model, seen: Observations, free: Bool[np.ndarray, " n"], lens_terms: int = 0, rounds: int = 20
) -> Model:
    """Adjust the poses of the frames that are `free`, all points that are observed, and of the lens no term (0), the
    focal length (1), or the distortion, too (3)."""
    bundle = _Bundle(seen, free, lens_terms, model.lens)
    damping, now = _DAMPING, _linearise(model, seen)
    cost = now.cost + bundle.prior_cost(model)
    for _ in range(rounds):
        while True:
            with suppress(np.linalg.LinAlgError):  # rounding left no minimum: more damping does
                tried = bundle.step(model, now, damping)
                after = _linearise(tried, seen)
                changed = after.cost + bundle.prior_cost(tried)
                if changed < cost:
                    break
            damping *= _FACTOR
            if damping > _MOST_DAMPING:
                return model
        decrease, damping = (cost - changed) / cost, max(damping / _FACTOR, _LEAST_DAMPING)
        model, now, cost = tried, after, changed
        if decrease < _ENOUGH:
            break
    return model


@dataclass(frozen=True)
class _Linear:
    """Residuals, their Jacobians, all weighted by the loss, and the cost."""

    residuals: Float[np.ndarray, "o 2"]
    by_camera: Float[np.ndarray, "o 2 6"]
    """By the rotation (on the left) and the translation of the frame."""
    by_lens: Float[np.ndarray, "o 2 3"]
    by_point: Float[np.ndarray, "o 2 3"]
    cost: float


@dataclass(frozen=True)
class _Bundle:
    """Frames, points and lens terms that are adjusted."""

    seen: Observations
    free: Bool[np.ndarray, " n"]
    lens_terms: int
    first: SharedLens

    @cached_property
    def points(self) -> Int[np.ndarray, " p"]:
        """Points that are observed."""
        return np.unique(self.seen.point)

    @cached_property
    def number(self) -> Int[np.ndarray, " o"]:
        """Point of each observation among these."""
        return np.searchsorted(self.points, self.seen.point)

    @cached_property
    def slots(self) -> Int[np.ndarray, " o"]:
        """Frame of each observation among the free ones, -1 where it is fixed."""
        return np.where(self.free, np.cumsum(self.free) - 1, -1)[self.seen.frame]

    def prior_cost(self, model: Model) -> float:
        """Cost of a lens that differs from the first one, or that distorts."""
        return float((self._away(model.lens) ** 2).sum())

    def _away(self, lens: SharedLens) -> Float[np.ndarray, "3"]:
        return np.array([np.log(lens.focal / self.first.focal), lens.k1, lens.k2]) / _PRIOR

    def step(self, model: Model, now: _Linear, damping: float) -> Model:
        """Return the model after one step."""
        count, moved = len(self.points), self.slots >= 0
        size, lens = 6 * int(self.free.sum()), model.lens
        # normal equations of the points, and what is left when they are eliminated
        sides = -sum_matrices(now.by_point.mT @ now.residuals[:, :, None], self.number, count)[:, :, 0]
        own = sum_matrices(now.by_point.mT @ now.by_point, self.number, count) + 1e-12 * np.eye(3)
        inverse = np.linalg.inv(own * (1 + damping * np.eye(3)))
        ties, lens_ties = now.by_camera.mT @ now.by_point, now.by_lens.mT @ now.by_point  # W
        lens_tied = sum_matrices(lens_ties, self.number, count)
        left = ties @ inverse[self.number]
        system, right = np.zeros((size + 3, size + 3)), np.zeros(size + 3)
        offsets = np.searchsorted(self.number, np.arange(count + 1))
        _subtract_pairs(offsets, self.slots, left, ties, system)
        cross = now.by_camera.mT @ now.by_lens - left @ lens_tied[self.number].mT
        rising = now.by_camera.mT @ now.residuals[:, :, None] + left @ sides[self.number][:, :, None]
        diagonal = (now.by_camera.mT @ now.by_camera) * (1 + damping * np.eye(6))
        for of, block in ((slice(0, 6), diagonal), (slice(size, None), cross)):
            summed = sum_matrices(block[moved], self.slots[moved], size // 6)
            for slot in range(size // 6):
                columns = slice(6 * slot, 6 * slot + 6) if of.start == 0 else of
                system[6 * slot : 6 * slot + 6, columns] += summed[slot]
        right[:size] = -sum_matrices(rising[moved], self.slots[moved], size // 6).ravel()
        system[size:, size:] = (now.by_lens.mT @ now.by_lens).sum(0) - (lens_tied @ inverse @ lens_tied.mT).sum(0)
        right[size:] = -(now.by_lens.mT @ now.residuals[:, :, None]).sum(0)[:, 0]
        right[size:] -= (lens_tied @ inverse @ sides[:, :, None]).sum(0)[:, 0]
        # the lens's prior; the derivative by the focal length is one by its logarithm
        weights = 1 / (_PRIOR * [lens.focal, 1, 1])
        system[np.arange(size, size + 3), np.arange(size, size + 3)] += weights**2
        right[size:] -= weights * self._away(lens)
        step, solved = np.zeros(size + 3), slice(0, size + self.lens_terms)
        step[solved] = cho_solve(cho_factor(system[solved, solved]), right[solved])  # by the upper triangle
        # back to the points
        by_step = now.by_lens @ step[size:]
        by_step[moved] += (now.by_camera[moved] @ step[:size].reshape(-1, 6)[self.slots[moved]][:, :, None])[:, :, 0]
        sides -= sum_matrices(now.by_point.mT @ by_step[:, :, None], self.number, count)[:, :, 0]
        return self._moved(model, step, (inverse @ sides[:, :, None])[:, :, 0])

    def _moved(self, model: Model, step: Float[np.ndarray, " s"], moves: Float[np.ndarray, "p 3"]) -> Model:
        motion, lens = step[:-3].reshape(-1, 6), model.lens
        rotations, translations, points = model.rotations.copy(), model.translations.copy(), model.points.copy()
        rotations[self.free] = Rotation.from_rotvec(motion[:, :3]).as_matrix() @ rotations[self.free]
        translations[self.free] += motion[:, 3:]
        points[self.points] += moves
        focal = lens.focal * float(np.exp(np.clip(step[-3] / lens.focal, -_STRETCH, _STRETCH)))
        lens = replace(lens, focal=focal, k1=lens.k1 + float(step[-2]), k2=lens.k2 + float(step[-1]))
        return Model(rotations, translations, points, lens)


def _linearise(model: Model, seen: Observations) -> _Linear:
    rotation, lens = model.rotations[seen.frame], model.lens
    turned = np.einsum("oij,oj->oi", rotation, model.points[seen.point])
    at = turned + model.translations[seen.frame]
    depth, behind = np.maximum(at[:, 2], _BEHIND), at[:, 2] <= _BEHIND
    u, v = at[:, 0] / depth, at[:, 1] / depth
    uv, square = np.stack([u, v], 1), u * u + v * v
    factor, slope = 1 + lens.k1 * square + lens.k2 * square**2, 2 * (lens.k1 + 2 * lens.k2 * square)
    residuals = lens.focal * factor[:, None] * uv + lens.center - seen.pixels
    off = np.linalg.norm(residuals, axis=1)
    loss = np.where(behind, _BEHIND_COST, np.where(off < _LOSS, off**2, 2 * _LOSS * off - _LOSS**2))
    weight = np.where(behind, 0, np.sqrt(np.minimum(1.0, _LOSS / np.maximum(off, _BEHIND))))[:, None]
    zero = np.zeros_like(u)
    by_uv = lens.focal * (factor[:, None, None] * np.eye(2) + slope[:, None, None] * uv[:, :, None] * uv[:, None])
    uv_by_at = np.stack([np.stack([1 / depth, zero, -u / depth], 1), np.stack([zero, 1 / depth, -v / depth], 1)], 1)
    by_at = weight[:, :, None] * (by_uv @ uv_by_at)
    x, y, z = turned.T
    by_turn = np.stack([np.stack([zero, z, -y], 1), np.stack([-z, zero, x], 1), np.stack([y, -x, zero], 1)], 1)
    by_terms = np.stack([factor, lens.focal * square, lens.focal * square**2], 1)
    return _Linear(
        weight * residuals, np.concatenate([by_at @ by_turn, by_at], 2), (weight * uv)[:, :, None] * by_terms[:, None],
        by_at @ rotation, float(loss.sum()),
    )  # fmt: skip


@kernel()
def _subtract_pairs(offsets, slots, left, right, system):
    """Subtract from `system` (6 n, 6 n), above its diagonal blocks and in them, what points tie cameras together by.

    Point p is observed by offsets[p] to before offsets[p + 1]; `slots` is the camera of each observation among the n,
    -1 for none. The block of two observations of a point is left (6, 3) of the first by right (6, 3) of the second.
    """
    for p in range(offsets.shape[0] - 1):
        for one in range(offsets[p], offsets[p + 1]):
            for other in range(offsets[p], offsets[p + 1]):
                if slots[one] < 0 or slots[other] < slots[one]:
                    continue
                row, column = 6 * slots[one], 6 * slots[other]
                for i in range(6):
                    for j in range(6):
                        system[row + i, column + j] -= (
                            left[one, i, 0] * right[other, j, 0]
                            + left[one, i, 1] * right[other, j, 1]
                            + left[one, i, 2] * right[other, j, 2]
                        )
