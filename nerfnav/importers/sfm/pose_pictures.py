"""Pose the pictures of one camera: features, matches, then frame by frame; a report after each part."""

import math
import time
from collections.abc import Generator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from enum import Enum, auto
from functools import partial
from pathlib import Path

import cv2
import numpy as np

from nerfnav.core.steps import map_steps
from nerfnav.importers.core.placement import OPENGL
from nerfnav.importers.core.progress import SparseModel
from nerfnav.importers.sfm.features import Features, Matches, find_features, join_tracks, match_features, pair_frames
from nerfnav.importers.sfm.incremental import Reconstruction, reconstruct

_FRAMES_AT_ONCE, _PAIRS_AT_ONCE = 8, 32
"""Frames and pairs between two reports."""
_TRACK = 3
"""Fewest frames that show a point which counts: two agree by chance."""
_SHOWN_EVERY_S, _FEW = 1.5, 5
"""Time between two models that are shown, and fewest frames of one: with fewer, up is not known."""
_AGREEING = 30
"""Matches of two frames that show the same."""


class Stage(Enum):
    """Stage of structure from motion."""

    FEATURES = auto()
    MATCHES = auto()
    POSES = auto()


@dataclass(frozen=True)
class StageReport:
    """Progress of a stage."""

    stage: Stage
    """The stage."""
    done: int
    """Frames or pairs that are done; of poses, those in the present model."""
    model: SparseModel | None = None
    """Cameras and points, now and then."""


@dataclass(frozen=True, eq=False)
class PosedPictures:
    """Poses of pictures, and what they were found by."""

    made: Reconstruction | None
    """The largest model; None where no two pictures show the same from two places."""
    size: tuple[int, int]
    """Width and height of each picture [pixels]."""
    features: float
    """Features of a picture, on average."""
    agreeing: float
    """Share of the matched pairs that show the same."""

    @property
    def model(self) -> SparseModel:
        """Cameras and points of the largest model."""
        return SparseModel(np.zeros((0, 4, 4)), np.zeros((0, 3))) if self.made is None else sparse_model(self.made)


def pose_pictures(pictures: Sequence[Path], threads: int) -> Generator[StageReport, None, PosedPictures]:
    """Pose pictures of one camera, in the order in which it took them. Raises OSError for one that cannot be read."""
    first = cv2.imread(str(pictures[0]))
    if first is None:
        raise OSError(f"{pictures[0]} cannot be read")
    height, width = first.shape[:2]
    features, matches, pairs = list[Features](), list[Matches](), list(pair_frames(len(pictures)))
    with ThreadPoolExecutor(threads) as pool:
        for done in range(0, len(pictures), _FRAMES_AT_ONCE):
            yield StageReport(Stage.FEATURES, done)
            features += pool.map(find_features, pictures[done : done + _FRAMES_AT_ONCE])
        for done in range(0, len(pairs), _PAIRS_AT_ONCE):
            yield StageReport(Stage.MATCHES, done)
            ends = list(zip(*pairs[done : done + _PAIRS_AT_ONCE], strict=True))
            shown = ([features[frame] for frame in end] for end in ends)
            found = pool.map(partial(match_features, side=max(width, height)), *shown)
            matches += map(Matches, *ends, found)
    counts = np.array([len(each.pixels) for each in features])
    agreeing = np.array([len(each.pairs) >= _AGREEING for each in matches])
    yield StageReport(Stage.POSES, 0)
    matches = [each for each in matches if len(each.pairs)]
    made = None
    if matches:
        seen = join_tracks(features, matches)
        made = yield from map_steps(reconstruct(seen, matches, features, (width, height)), _Reporter().report)
    return PosedPictures(made, (width, height), float(counts.mean()), float(agreeing.mean()) if len(pairs) else 0.0)


class _Reporter:
    """Reports models, and shows one now and then."""

    def __init__(self) -> None:
        self._shown_at = -math.inf

    def report(self, made: Reconstruction) -> StageReport:
        count, now = int(made.posed.sum()), time.monotonic()
        is_due = count >= _FEW and now > self._shown_at + _SHOWN_EVERY_S
        self._shown_at = now if is_due else self._shown_at
        return StageReport(Stage.POSES, count, sparse_model(made) if is_due else None)


def sparse_model(made: Reconstruction) -> SparseModel:
    """Cameras, and the points that enough of them show."""
    poses = np.tile(np.eye(4), (len(made.posed), 1, 1))
    poses[:, :3, :3], poses[:, :3, 3] = made.model.rotations.mT, made.model.centers
    shown = np.bincount(made.seen.point, made.counts, minlength=len(made.known)) >= _TRACK
    return SparseModel(poses[made.posed] @ OPENGL, made.model.points[shown])
