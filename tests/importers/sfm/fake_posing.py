"""Structure from motion that needs no pictures: each returns what it would have found."""

import time
from collections.abc import Generator, Sequence
from pathlib import Path

import numpy as np

from nerfnav.importers.sfm.incremental import Reconstruction
from nerfnav.importers.sfm.model import Model, Observations, SharedLens
from nerfnav.importers.sfm.pose_pictures import PosedPictures, Stage, StageReport, sparse_model

SIZE = (160, 120)
Posing = Generator[StageReport, None, PosedPictures]


def made(frames: int, posed: int, points: int = 100) -> Reconstruction:
    """The first frames have poses: their cameras look along z and stand beside each other."""
    places = np.random.default_rng(0).uniform(-1, 1, (points, 3)) + np.array([0, 0, 3.0])
    translations = np.stack([-0.1 * np.arange(frames), np.zeros(frames), np.zeros(frames)], 1)
    model = Model(np.tile(np.eye(3), (frames, 1, 1)), translations, places, SharedLens(160.0, (80.0, 60.0)))
    point, frame = (each.ravel() for each in np.meshgrid(np.arange(points), np.arange(frames), indexing="ij"))
    seen = Observations(frame, point, model.project(frame, point)[0])
    has_pose = np.arange(frames) < posed
    return Reconstruction(seen, model, has_pose, np.ones(points, bool), np.ones(len(frame), bool), 2.0)


def pose_all(pictures: Sequence[Path], threads: int) -> Posing:
    """Poses are found for all frames but the last two, after a first try that finds fewer."""
    count = len(pictures)
    yield StageReport(Stage.FEATURES, 0)
    yield StageReport(Stage.MATCHES, 8 * threads // threads)
    for posed in (4, 2, count - 2):
        yield StageReport(Stage.POSES, posed, sparse_model(made(count, posed)))
    return PosedPictures(made(count, count - 2), SIZE, 900, 0.9)


def pose_few(pictures: Sequence[Path], threads: int) -> Posing:
    """Poses are found for two frames, of many that agree with each other."""
    yield StageReport(Stage.POSES, 0)
    return PosedPictures(made(len(pictures), 2), SIZE, 900, 0.6)


def pose_by_chance(pictures: Sequence[Path], threads: int) -> Posing:
    """Poses are found for all frames by ten points."""
    yield StageReport(Stage.POSES, 0)
    return PosedPictures(made(len(pictures), len(pictures), points=10), SIZE, 60, 0.1)


def pose_none(pictures: Sequence[Path], threads: int) -> Posing:
    """No frames show the same."""
    yield StageReport(Stage.POSES, 0)
    return PosedPictures(None, SIZE, 900, 0.1)


def refuse(pictures: Sequence[Path], threads: int) -> Posing:
    """Must not be called."""
    raise AssertionError(f"{len(pictures)} pictures are posed again with {threads} threads")
    yield


def wait(pictures: Sequence[Path], threads: int) -> Posing:
    """Works for long."""
    for done in range(10_000):
        time.sleep(0.01)
        yield StageReport(Stage.FEATURES, done % len(pictures))
    raise AssertionError("it was not stopped")
