"""Features of frames, matches of pairs, and the tracks that they make.

Features are SIFT's (Lowe, "Distinctive image features from scale-invariant keypoints", IJCV 2004), compared as RootSIFT
(Arandjelovic and Zisserman, "Three things everyone should know to improve object retrieval", CVPR 2012). The matches of
a pair count where one fundamental matrix explains them (MAGSAC++, Barath et al., CVPR 2020). All of it by OpenCV.
"""

import itertools
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from nerfnav.importers.sfm.model import Observations

_PIXELS = 1200
"""Longest side of pictures in which features are looked for [pixels]: phones film more than poses need."""
_COUNT = 4096
"""Features of a frame, at most: time grows with their square."""
_CONTRAST = 0.02
"""Least contrast of a feature: half of OpenCV's, for plain walls have few."""
_RATIO = 0.8
"""Largest distance of a feature's best match, relative to that of its second best."""
_OFF = 1.5e-3
"""Largest distance of a match from its epipolar line, as a share of the longest side; at least one pixel."""
_DRAWS = 2000
"""Draws of MAGSAC++, at most."""
_FEWEST = 15
"""Fewest matches of a pair that one fundamental matrix explains."""
_AHEAD, _CLOSING = 8, 5
"""Each frame is matched with so many after it, and each of every fifth with all others of these."""


@dataclass(frozen=True)
class Features:
    """Features of a frame."""

    pixels: Float[np.ndarray, "k 2"]
    """Places [pixels]; pixel corners are at whole numbers."""
    descriptors: Float[np.ndarray, "k 128"]
    """RootSIFT, of length 1."""


@dataclass(frozen=True)
class Matches:
    """Matches of two frames."""

    first: int
    """Index of a frame."""
    second: int
    """Index of the other."""
    pairs: Int[np.ndarray, "m 2"]
    """Indices of a feature of each."""


def find_features(picture: Path) -> Features:
    """Find the features of a frame."""
    grey = cv2.imread(str(picture), cv2.IMREAD_GRAYSCALE)
    if grey is None:
        raise OSError(f"{picture} cannot be read")
    shrink = min(1.0, _PIXELS / max(grey.shape))
    if shrink < 1:
        grey = cv2.resize(grey, None, fx=shrink, fy=shrink, interpolation=cv2.INTER_AREA)
    sift = cv2.SIFT_create(nfeatures=_COUNT, contrastThreshold=_CONTRAST)  # type: ignore[attr-defined]
    keypoints, descriptors = sift.detectAndCompute(grey, None)
    if descriptors is None:
        return Features(np.zeros((0, 2)), np.zeros((0, 128), np.float32))
    places = np.array([point.pt for point in keypoints])
    _, once = np.unique(places.round(2), axis=0, return_index=True)  # a place has a feature for each of its directions
    root = np.sqrt(descriptors[once] / np.maximum(descriptors[once].sum(1, keepdims=True), 1e-9))
    # OpenCV's pixel centres are whole numbers, ours are halves
    return Features((places[once] + 0.5) / shrink, root.astype(np.float32))


def match_features(first: Features, second: Features, side: float) -> Int[np.ndarray, "m 2"]:
    """Match the features of two frames whose longest side is `side` [pixels]; none where they show different things."""
    nothing = np.zeros((0, 2), int)
    if min(len(first.pixels), len(second.pixels)) < _FEWEST:
        return nothing
    alike = first.descriptors @ second.descriptors.T
    back = alike.argmax(0)
    rows, best = np.arange(len(alike)), alike.argmax(1)
    nearest = alike[rows, best]
    alike[rows, best] = -1
    clear = 1 - nearest < _RATIO**2 * (1 - alike.max(1))
    kept = np.flatnonzero(clear & (back[best] == rows))
    pairs = np.stack([kept, best[kept]], 1)
    if len(pairs) < _FEWEST:
        return nothing
    ends = first.pixels[pairs[:, 0]], second.pixels[pairs[:, 1]]
    explained = _explained(*ends, max(1.0, _OFF * side))
    pairs = pairs[explained.ravel() > 0] if explained is not None else nothing
    return pairs if len(pairs) >= _FEWEST else nothing


def _explained(
    first: Float[np.ndarray, "m 2"], second: Float[np.ndarray, "m 2"], off: float
) -> np.ndarray | None:
    """Mask of the matches that one motion of the camera explains; None where none does."""
    with suppress(cv2.error):  # frames that a camera took from one place have no fundamental matrix
        _, explained = cv2.findFundamentalMat(first, second, cv2.USAC_MAGSAC, off, 0.999, _DRAWS)
        if explained is not None:
            return explained
    with suppress(cv2.error):
        return cv2.findHomography(first, second, cv2.USAC_MAGSAC, off, maxIters=_DRAWS)[1]
    return None


def join_tracks(features: Sequence[Features], matches: Sequence[Matches]) -> Observations:
    """Join matches to tracks; a frame that shows two features of one does not count in it."""
    begins = np.cumsum([0, *(len(each.pixels) for each in features)])
    ends = [begins[[each.first, each.second]] + each.pairs for each in matches]
    one, other = np.concatenate([np.zeros((0, 2), int), *ends]).T
    graph = coo_array((np.ones(len(one), bool), (one, other)), shape=(begins[-1], begins[-1]))
    _, point = connected_components(graph, directed=False)
    node = np.unique(np.concatenate([one, other]))
    frame, point = np.searchsorted(begins, node, side="right") - 1, point[node]
    _, which, times = np.unique(np.stack([point, frame]), axis=1, return_inverse=True, return_counts=True)
    alone = times[which.ravel()] == 1
    node, frame, point = node[alone], frame[alone], point[alone]
    _, which, times = np.unique(point, return_inverse=True, return_counts=True)
    kept = np.flatnonzero(times[which] > 1)
    kept = kept[np.argsort(point[kept], kind="stable")]
    _, number = np.unique(point[kept], return_inverse=True)
    pixels = np.concatenate([np.zeros((0, 2)), *(each.pixels for each in features)])
    return Observations(frame[kept], number, pixels[node[kept]])


def pair_frames(count: int) -> Iterator[tuple[int, int]]:
    """Yield the pairs of frames to match: each with those after it, and of every fifth all, which closes loops."""
    for first in range(count):
        yield from ((first, second) for second in range(first + 1, min(first + 1 + _AHEAD, count)))
    apart = itertools.combinations(range(0, count, _CLOSING), 2)
    yield from ((first, second) for first, second in apart if second - first > _AHEAD)
