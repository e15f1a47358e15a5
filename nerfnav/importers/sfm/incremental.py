"""Incremental structure from motion: begin with a pair of frames, and pose the others one by one.

The next frame is the one that shows most known points. Its pose follows from these (perspective n points, RANSAC), then
new points from all frames that show them. Bundle adjustment of the frames around it, and now and then of all, keeps
errors from growing (the order of Schoenberger and Frahm, "Structure-from-motion revisited", CVPR 2016).
"""

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace

import cv2
import numpy as np
from jaxtyping import Bool

from nerfnav.importers.sfm.bundle import adjust
from nerfnav.importers.sfm.features import Features, Matches
from nerfnav.importers.sfm.first_pair import FirstPair, guess_focal, rate_first_pairs
from nerfnav.importers.sfm.model import Model, Observations, SharedLens, sum_matrices

_NARROW = np.sin(np.deg2rad(0.75))
"""Root mean square of the sines between the rays of a point and their middle, at least."""
_OFF, _LEAST_OFF = 4e-3, 2.0
"""Largest distance of a point from its place in a frame, as a share of the longest side; and at least [pixels]."""
_LEAST_POINTS, _LEAST_SHARE = 20, 0.25
"""Known points that a frame must agree with, and for a new one their share of those that it shows."""
_TRIES = 3
"""Times that a frame is posed, at most: one that agrees with too little after an adjustment loses its pose."""
_DRAWS = 1000
"""Draws of RANSAC, at most."""
_ROUNDS = 10
"""Rounds of an adjustment of all."""
_NEAR, _NEAR_ROUNDS = 7, 5
"""Frames that are adjusted after each new one, which is one of them, and rounds of that."""
_GROWTH, _FEW = 1.2, 7
"""Growth of the number of frames after which all are adjusted, and the number up to which they always are."""
_FOCAL_FROM, _DISTORTION_FROM = 4, 7
"""Frames from which the focal length and the distortion are adjusted."""
_LAST, _LAST_ROUNDS = 2, 30
"""Adjustments of all at the end, with all points placed anew, and rounds of each."""
_STARTS = 6
"""First pairs that are tried, at most: each with a frame that had no pose so far."""
_MOST = 0.5
"""Share of the frames with which a model is the largest."""


@dataclass
class Reconstruction:
    """Frames with poses, and points, as they grow."""

    seen: Observations
    """All observations of all frames."""
    model: Model
    """Poses and points; those that are not known yet mean nothing."""
    posed: Bool[np.ndarray, " n"]
    """Frames that have a pose."""
    known: Bool[np.ndarray, " m"]
    """Points that have a place."""
    agrees: Bool[np.ndarray, " o"]
    """Observations that agree with their points."""
    off: float
    """Distance from which one does not [pixels]."""

    @property
    def counts(self) -> Bool[np.ndarray, " o"]:
        """Observations of known points by frames with poses, which agree with them."""
        return self.agrees & self.posed[self.seen.frame] & self.known[self.seen.point]


def reconstruct(
    seen: Observations, matches: Sequence[Matches], features: Sequence[Features], size: tuple[int, int]
) -> Generator[Reconstruction, None, Reconstruction | None]:
    """Pose frames of `size` [pixels]; yield the model after each frame, and return the largest one.

    None where no two frames show the same from two places.
    """
    width, height = size
    lens = SharedLens(guess_focal(matches, features, size), (width / 2, height / 2))
    best, starts, tried = None, 0, np.zeros(len(features), bool)
    for pair in rate_first_pairs(matches, features, lens) if len(seen.frame) else ():
        if starts == _STARTS or tried.sum() > _MOST * len(features):
            break
        if tried[pair.first] and tried[pair.second]:
            continue
        made = _begin(seen, pair, lens, len(features), max(_LEAST_OFF, _OFF * max(size)))
        yield from _grow(made)
        best = made if best is None or made.posed.sum() > best.posed.sum() else best
        starts, tried = starts + 1, tried | made.posed
    return best if best is not None and best.posed.any() else None


def _begin(seen: Observations, pair: FirstPair, lens: SharedLens, frames: int, off: float) -> Reconstruction:
    rotations, translations = np.tile(np.eye(3), (frames, 1, 1)), np.zeros((frames, 3))
    rotations[pair.second], translations[pair.second] = pair.rotation, pair.translation
    count, posed = int(seen.point[-1]) + 1, np.isin(np.arange(frames), [pair.first, pair.second])
    model = Model(rotations, translations, np.zeros((count, 3)), lens)
    made = Reconstruction(seen, model, posed, np.zeros(count, bool), np.ones(len(seen.frame), bool), off)
    _triangulate(made, ~made.known)
    _adjust(made, posed)
    return made


def _grow(made: Reconstruction) -> Generator[Reconstruction, None, None]:
    """Pose frame after frame, until none agrees with what is known."""
    seen, adjusted = made.seen, int(made.posed.sum())
    refused, tries = np.zeros_like(made.posed), np.zeros(len(made.posed), int)
    yield made
    while True:
        shows = np.bincount(seen.frame, made.known[seen.point], minlength=len(made.posed))
        index = int((shows := np.where(made.posed | refused | (tries == _TRIES), 0, shows)).argmax())
        is_new = shows[index] >= _LEAST_POINTS
        if not is_new and (made.posed.sum() == adjusted or not refused.any()):
            break
        if is_new:
            tries[index] += 1
            if not _pose(made, index):
                refused[index] = True
                continue
            _triangulate(made, ~made.known & _shown(made, seen.frame == index))
        count = int(made.posed.sum())
        if not is_new or count >= _GROWTH * adjusted or count <= _FEW:
            _adjust(made, made.posed)  # those that were refused may agree then
            _triangulate(made, ~made.known)
            adjusted, refused[:] = count, False
        else:
            _adjust(made, _near(made, index), _NEAR_ROUNDS)
        yield made
    for _ in range(_LAST):
        _triangulate(made, np.ones_like(made.known))
        _adjust(made, made.posed, _LAST_ROUNDS)
        yield made


def _pose(made: Reconstruction, index: int) -> bool:
    """Pose a frame by the known points that it shows; False where too few agree."""
    seen, lens = made.seen, made.model.lens
    shown = seen.only((seen.frame == index) & made.known[seen.point])
    points, rays = made.model.points[shown.point], lens.rays(shown.pixels)
    try:
        found, turn, place, agree = cv2.solvePnPRansac(
            points, rays, np.eye(3), None, iterationsCount=_DRAWS, reprojectionError=2 * made.off / lens.focal,
            confidence=0.9999, flags=cv2.SOLVEPNP_AP3P,
        )  # fmt: skip
        if not found or agree is None or len(agree) < max(_LEAST_POINTS, _LEAST_SHARE * len(points)):
            return False
        which = agree.ravel().astype(int)
        turn, place = cv2.solvePnPRefineLM(points[which], rays[which], np.eye(3), None, turn, place)
    except cv2.error:  # points that lie on a line have no pose
        return False
    made.model.rotations[index], made.model.translations[index] = cv2.Rodrigues(turn)[0], place[:, 0]
    made.posed[index] = True
    return True


def _triangulate(made: Reconstruction, wanted: Bool[np.ndarray, " m"]) -> None:
    """Place the points that are wanted where the rays to them pass nearest to each other.

    Rays that pass far off are left out in a second round. A point has no place where fewer than two are left, or where
    they are almost parallel.
    """
    model, total, which = made.model, len(made.known), made.posed[made.seen.frame] & wanted[made.seen.point]
    shown = made.seen.only(which)
    rays = np.pad(model.lens.rays(shown.pixels), ((0, 0), (0, 1)), constant_values=1)
    rays = np.einsum("oji,oj->oi", model.rotations[shown.frame], rays / np.linalg.norm(rays, axis=1, keepdims=True))
    across, centers = np.eye(3) - rays[:, :, None] * rays[:, None], model.centers[shown.frame]
    agrees, points, known = np.ones(len(rays), bool), model.points.copy(), np.zeros(total, bool)
    for most in (2 * made.off, made.off):
        matrix = sum_matrices(across * agrees[:, None, None], shown.point, total)
        side = sum_matrices((across @ centers[:, :, None]) * agrees[:, None, None], shown.point, total)
        count = np.bincount(shown.point, agrees, minlength=total)
        several = np.flatnonzero(count >= 2)
        apart = np.linalg.eigvalsh(matrix[several])[:, 0] > count[several] * _NARROW**2
        placed = several[apart]
        points[placed] = np.linalg.solve(matrix[placed], side[placed])[:, :, 0]
        known = np.isin(np.arange(total), placed)
        pixels, depth = replace(model, points=points).project(shown.frame, shown.point)
        agrees = known[shown.point] & (depth > 0) & (np.linalg.norm(pixels - shown.pixels, axis=1) < most)
    known &= np.bincount(shown.point, agrees, minlength=total) >= 2
    model.points[known] = points[known]
    made.known[wanted] = known[wanted]
    made.agrees[which] = agrees | ~known[shown.point]


def _adjust(made: Reconstruction, free: Bool[np.ndarray, " n"], rounds: int = _ROUNDS) -> None:
    """Adjust frames and the points that they show; where all are free, the lens, too. Leave out what disagrees then."""
    seen, counts, every = made.seen, made.counts, bool(free[made.posed].all())
    if not every:
        counts &= _shown(made, counts & free[seen.frame])[seen.point]
    if not counts.any():
        made.posed &= ~free
        return
    count = int(made.posed.sum())
    terms = 0 if not every or count < _FOCAL_FROM else 1 if count < _DISTORTION_FROM else 3
    made.model = adjust(made.model, seen.only(counts), free, terms, rounds)
    pixels, depth = made.model.project(seen.frame, seen.point)
    agrees = (depth > 0) & (np.linalg.norm(pixels - seen.pixels, axis=1) < made.off)
    known = made.posed[seen.frame] & made.known[seen.point]
    made.agrees[known] = agrees[known]
    made.posed &= np.bincount(seen.frame, made.counts, minlength=len(made.posed)) >= _LEAST_POINTS
    made.known &= np.bincount(seen.point, made.counts, minlength=len(made.known)) >= 2


def _shown(made: Reconstruction, by: Bool[np.ndarray, " o"]) -> Bool[np.ndarray, " m"]:
    """Points of some observations."""
    return np.bincount(made.seen.point, by, minlength=len(made.known)) > 0


def _near(made: Reconstruction, index: int) -> Bool[np.ndarray, " n"]:
    """Frames that share most points with one, and that one."""
    shown = _shown(made, made.counts & (made.seen.frame == index))
    shared = np.bincount(made.seen.frame, made.counts & shown[made.seen.point], minlength=len(made.posed))
    near = np.isin(np.arange(len(shared)), np.argsort(-shared)[:_NEAR])
    return near & made.posed & (shared > 0)
