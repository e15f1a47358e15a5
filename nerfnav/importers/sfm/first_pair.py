"""First pair: two frames to begin a model with, and the focal length to begin with."""

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass

import cv2
import numpy as np
from jaxtyping import Float

from nerfnav.importers.sfm.features import Features, Matches
from nerfnav.importers.sfm.model import SharedLens

_FOCALS = np.geomspace(0.45, 2.2, 15)
"""Focal lengths that are tried, as shares of the picture's longest side: fields of view of 96 to 26 degrees."""
_JUDGED, _TRIED = 60, 150
"""Pairs that judge the focal length, and that are tried as the first one, at most."""
_LEAST_MATCHES, _LEAST_SHARE = 50, 0.5
"""Matches of a first pair that one motion explains, at least, and their share."""
_OFF = 2.0
"""Largest distance of such a match from its epipolar line [pixels]."""
_NARROW_DEG, _WIDE_DEG = 3.0, 12.0
"""Angle between the rays of a first pair's points, at least, and the one from which a wider one is no better."""
_FLAT = 0.9
"""Share of the matches that one homography explains, from which they may have no depth."""
_FAR = 8
"""Frames between two from which more say nothing more."""


@dataclass(frozen=True)
class FirstPair:
    """Two frames to begin with; the first one is the origin, and they are a unit apart."""

    first: int
    """A frame."""
    second: int
    """The other."""
    rotation: Float[np.ndarray, "3 3"]
    """R_camera_world of the second."""
    translation: Float[np.ndarray, "3"]
    """t_camera_world of the second."""


def guess_focal(matches: Sequence[Matches], features: Sequence[Features], size: tuple[int, int]) -> float:
    """Guess the focal length of frames of `size` [pixels]: with the right one, the two singular values of an essential
    matrix are equal (Mendonca and Cipolla, "A simple technique for self-calibration", CVPR 1999)."""
    side, middle, unequal = max(size), np.array(size) / 2, []
    for each in sorted(matches, key=lambda each: -len(each.pairs) * min(_FAR, each.second - each.first))[:_JUDGED]:
        first, second = ((end - middle) / side for end in _ends(each, features))
        matrix, _ = cv2.findFundamentalMat(first, second, cv2.FM_8POINT)
        if matrix is not None and matrix.shape == (3, 3):
            scales = np.stack([np.diag([focal, focal, 1.0]) for focal in _FOCALS])
            values = np.linalg.svd(scales @ matrix @ scales, compute_uv=False)
            unequal.append((values[:, 0] - values[:, 1]) / (values[:, 0] + values[:, 1]))
    return float(side * (_FOCALS[np.mean(unequal, 0).argmin()] if unequal else 1.0))


def rate_first_pairs(
    matches: Sequence[Matches], features: Sequence[Features], lens: SharedLens
) -> list[FirstPair]:
    """Find the pairs that a model may begin with, the best first: many matches, wide angles, and depth.

    None where no frames show anything from two places.
    """
    rated = []
    strong = [each for each in matches if len(each.pairs) >= _LEAST_MATCHES]
    for each in sorted(strong, key=lambda each: -len(each.pairs) * min(_FAR, each.second - each.first) ** 0.5)[:_TRIED]:
        with suppress(cv2.error):  # frames that a camera took from one place have no essential matrix
            first, second = map(lens.rays, _ends(each, features))
            rated += _rate(each, first, second, _OFF / lens.focal)
    return [pair for _, pair in sorted(rated, key=lambda each: -each[0])]


def _ends(matches: Matches, features: Sequence[Features]) -> list[Float[np.ndarray, "m 2"]]:
    frames = (matches.first, matches.second)
    return [features[frame].pixels[end] for frame, end in zip(frames, matches.pairs.T, strict=True)]


def _rate(
    matches: Matches, first: Float[np.ndarray, "m 2"], second: Float[np.ndarray, "m 2"], off: float
) -> list[tuple[float, FirstPair]]:
    """Rate a pair by the rays of its matches; nothing where it is none to begin with."""
    essential, agree = cv2.findEssentialMat(first, second, np.eye(3), cv2.USAC_MAGSAC, 0.999, off)
    if essential is None or essential.shape != (3, 3):
        return []
    count, rotation, translation, agree = cv2.recoverPose(essential, first, second, np.eye(3), mask=agree)
    agree = agree.ravel() > 0
    if count < max(_LEAST_MATCHES, _LEAST_SHARE * len(first)):
        return []
    _, flat = cv2.findHomography(first[agree], second[agree], cv2.USAC_MAGSAC, 2 * off)
    one, other = (np.pad(rays[agree], ((0, 0), (0, 1)), constant_values=1) for rays in (first, second))
    other = other @ rotation
    cosine = (one * other).sum(1) / np.linalg.norm(one, axis=1) / np.linalg.norm(other, axis=1)
    angle = float(np.rad2deg(np.median(np.arccos(np.clip(cosine, -1, 1)))))
    if angle < _NARROW_DEG or (flat is not None and flat.mean() > _FLAT):
        return []
    pair = FirstPair(matches.first, matches.second, rotation, translation[:, 0])
    return [(count * min(angle, _WIDE_DEG), pair)]
