"""Structure from motion: pose the frames of a video by pycolmap, in a process of its own.

The process keeps COLMAP's log out of the terminal, ends at once where a user cancels, and takes nothing with it where
COLMAP aborts. It imports nothing slow but pycolmap.
"""

import importlib
import itertools
import os
import signal
import time
from collections.abc import Iterator
from dataclasses import dataclass
from enum import Enum, auto
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from nerfnav.importers.core.progress import SparseModel

DATABASE, LOG = "database.db", "posing.log"
"""Files of COLMAP in the capture's folder."""
_PIXELS = 1200
"""Longest side of pictures in which features are looked for [pixels]: phones film more than poses need."""
_FEATURES = 4096
"""Features of a frame, at most: time grows with their square."""
_AHEAD, _CLOSING = 8, 5
"""Each frame is matched with so many after it, and each of every fifth with all others of these: that closes loops."""
_FRAMES_AT_ONCE, _PAIRS_AT_ONCE = 8, 32
"""Frames and pairs between two reports."""
_SMALLEST = 3
"""Fewest frames of a model."""
_MODELS = 3
"""Models that are tried, at most: what does not belong to the first of them seldom belongs together."""
_TRACK = 3
"""Fewest frames that see a point which is shown."""
_SHOWN_EVERY_S, _FEW = 1.5, 5
"""Time between two models that are shown, and fewest frames of one: with fewer, up is not known."""
_OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])


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


@dataclass(frozen=True)
class PosingFailure:
    """COLMAP raised an error."""

    message: str
    """Its message."""


def pair_frames(names: list[str]) -> Iterator[tuple[str, str]]:
    """Yield the pairs of frames to match: neighbours, and some far apart, which closes loops."""
    for index, name in enumerate(names):
        yield from ((name, later) for later in names[index + 1 : index + 1 + _AHEAD])
    apart = itertools.combinations(range(0, len(names), _CLOSING), 2)
    yield from ((names[first], names[second]) for first, second in apart if second - first > _AHEAD)


def pose_frames(folder: Path, threads: int, sender: Connection) -> None:
    """Pose the pictures of `folder`/images into `folder`/sparse; runs in a process of its own.

    Sends StageReports, then the largest model as a SparseModel, or a PosingFailure.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # Ctrl-C is for the process that started it, which then ends this one
    log = os.open(folder / LOG, os.O_WRONLY | os.O_CREAT)
    for stream in (1, 2):
        os.dup2(log, stream)
    try:
        pycolmap: Any = importlib.import_module("pycolmap")  # optional
        pycolmap.logging.minloglevel = 2
        pycolmap.set_random_seed(0)
        _extract_features(pycolmap, folder, threads, sender)
        _match(pycolmap, folder, threads, sender)
        sender.send(_pose(pycolmap, folder, threads, sender))
    except BrokenPipeError:  # its parent has gone
        return
    except (RuntimeError, ValueError, TypeError, OSError) as error:
        sender.send(PosingFailure(str(error)))
    sender.close()


def _extract_features(pycolmap: Any, folder: Path, threads: int, sender: Connection) -> None:
    """Find features in some frames at a time, all of which one camera took."""
    options = pycolmap.FeatureExtractionOptions(num_threads=threads, max_image_size=_PIXELS)
    options.sift.max_num_features = _FEATURES
    reader, names = pycolmap.ImageReaderOptions(camera_model="OPENCV"), _names(folder)
    for done in range(0, len(names), _FRAMES_AT_ONCE):
        sender.send(StageReport(Stage.FEATURES, done))
        pycolmap.extract_features(
            folder / DATABASE,
            folder / "images",
            names[done : done + _FRAMES_AT_ONCE],
            camera_mode=pycolmap.CameraMode.SINGLE,
            reader_options=reader,
            extraction_options=options,
        )
        with pycolmap.Database.open(folder / DATABASE) as database:
            reader.existing_camera_id = database.read_all_cameras()[0].camera_id


def _match(pycolmap: Any, folder: Path, threads: int, sender: Connection) -> None:
    """Match features in some pairs of frames at a time."""
    pairs, listed = list(pair_frames(_names(folder))), folder / "pairs.txt"
    for done in range(0, len(pairs), _PAIRS_AT_ONCE):
        sender.send(StageReport(Stage.MATCHES, done))
        listed.write_text("".join(f"{first} {second}\n" for first, second in pairs[done : done + _PAIRS_AT_ONCE]))
        pycolmap.match_image_pairs(
            folder / DATABASE,
            matching_options=pycolmap.FeatureMatchingOptions(num_threads=threads),
            pairing_options=pycolmap.ImportedPairingOptions(match_list_path=str(listed)),
        )


def _names(folder: Path) -> list[str]:
    return sorted(path.name for path in (folder / "images").iterdir())


def _pose(pycolmap: Any, folder: Path, threads: int, sender: Connection) -> SparseModel:
    """Pose frame by frame (incremental structure from motion), write the models, and return the largest."""
    sender.send(StageReport(Stage.POSES, 0))
    models, shown_at = pycolmap.ReconstructionManager(), 0.0
    options = pycolmap.IncrementalPipelineOptions(
        num_threads=threads,
        min_model_size=_SMALLEST,
        max_num_models=_MODELS,
        extract_colors=False,
        image_path=str(folder / "images"),
    )

    def report() -> None:
        nonlocal shown_at
        model = models.get(models.size() - 1)
        is_due = time.monotonic() > shown_at + _SHOWN_EVERY_S and model.num_reg_images() >= _FEW
        sender.send(StageReport(Stage.POSES, model.num_reg_images(), _sparse(model) if is_due else None))
        shown_at = time.monotonic() if is_due else shown_at

    pipeline = pycolmap.IncrementalPipeline(options, pycolmap.Database.open(folder / DATABASE), models)
    for event in ("INITIAL_IMAGE_PAIR_REG_CALLBACK", "NEXT_IMAGE_REG_CALLBACK"):
        pipeline.add_callback(getattr(pycolmap.IncrementalPipelineCallback, event), report)
    pipeline.run()
    for index in range(models.size()):
        target = folder / "sparse" / str(index)
        target.mkdir(parents=True)
        models.get(index).write_binary(target)
    found = [models.get(index) for index in range(models.size())] or [pycolmap.Reconstruction()]
    return _sparse(max(found, key=lambda model: model.num_reg_images()))


def _sparse(model: Any) -> SparseModel:
    last = np.array([[0.0, 0.0, 0.0, 1.0]])
    poses = [
        np.linalg.inv(np.concatenate([image.cam_from_world().matrix(), last])) @ _OPENGL
        for image in model.images.values()
        if image.has_pose
    ]
    points = [point.xyz for point in model.points3D.values() if point.track.length() >= _TRACK]
    return SparseModel(np.array(poses).reshape(-1, 4, 4), np.array(points).reshape(-1, 3))
