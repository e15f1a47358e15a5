"""Posing: structure from motion of a capture's pictures, with its progress and its model as COLMAP's files, kept for
the next time; and the reason where pictures have no poses."""

import io
import zipfile
from collections.abc import Generator, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
import torch

from nerfnav.core import cache
from nerfnav.core.steps import map_steps
from nerfnav.formats import ColmapCamera, ColmapImage, ColmapPoint, write_colmap
from nerfnav.geometry import so3
from nerfnav.importers.core.progress import ImportStep, SparseModel
from nerfnav.importers.sfm.features import pair_frames
from nerfnav.importers.sfm.incremental import Reconstruction
from nerfnav.importers.sfm.pose_pictures import PosedPictures, Stage, StageReport, pose_pictures

_BEGINS = {Stage.FEATURES: 0.0, Stage.MATCHES: 0.15, Stage.POSES: 0.4}
_ENDS = {Stage.FEATURES: 0.15, Stage.MATCHES: 0.4, Stage.POSES: 1.0}
"""Shares of the time, measured with 50 frames of 360 x 640."""
_LABELS = {
    Stage.FEATURES: "finding features: {} of {} frames",
    Stage.MATCHES: "matching frames: {} of {} pairs",
    Stage.POSES: "{} of {} frames posed",
}
_KIND, _SHOWN = "poses", "shown.npz"
"""Kind of cached files, and the file of what is shown in them."""
_OVERLAPPING = 0.3
"""Share of the matched pairs that show the same in a video whose frames overlap."""
_DARK, _PLAIN = 45.0, 150
"""Brightness, 0 to 255, and features below which a frame is dark or plain."""


@dataclass(frozen=True, eq=False)
class Posing:
    """Cameras and points of a capture, and what they were found by."""

    model: SparseModel
    """Cameras and points; none where no two pictures show the same from two places."""
    features: float
    """Features of a picture, on average."""
    agreeing: float
    """Share of the matched pairs that show the same."""

    def explain_failure(self, brightness: float) -> str:
        """Explain why frames have no poses, and what to film otherwise; `brightness` is their median, 0 to 255.

        Frames that were filmed from one place agree with each other like others, but nothing of theirs has a distance.
        """
        if self.agreeing >= _OVERLAPPING:
            return (
                "its frames show the same things, but from one place: walk around the things that you film, rather "
                "than turn on the spot"
            )
        if brightness < _DARK:
            return f"it is dark, {brightness:.0f} of 255 in the middle: film with more light"
        if self.features < _PLAIN:
            return (
                f"its frames have {self.features:.0f} features each, {_PLAIN} are needed: film what has texture, in "
                "focus, with more light"
            )
        return (
            f"{self.agreeing:.0%} of its frames overlap with their neighbours: film more slowly, with more overlap and "
            "without jumps, while you walk around"
        )


def estimate_poses(folder: Path, threads: int, begin: float = 0.0) -> Generator[ImportStep, None, Posing]:
    """Pose the pictures of `folder`/images into `folder`/sparse, which makes it a capture.

    The same pictures are posed once on this machine, so that fields that are trained of them later have the same world.
    Progress goes from `begin` to 1.
    """
    pictures = sorted((folder / "images").iterdir())
    key = "\n".join([cv2.__version__, *(path.name for path in pictures)]).encode()
    key += cache.hash_code(Path(__file__).parent, *pictures)
    if (kept := cache.load(_KIND, key)) is None:
        progress = _Progress(len(pictures), len(list(pair_frames(len(pictures)))), begin)
        posed = yield from map_steps(pose_pictures(pictures, threads), progress.step)
        if posed.made is not None:
            _write(posed.made, posed.size, [path.name for path in pictures], folder / "sparse" / "0")
        kept = cache.store(_KIND, key, _pack(posed, folder))
    posing = _unpack(kept, folder)
    label = _LABELS[Stage.POSES].format(len(posing.model.poses), len(pictures))
    yield ImportStep(label, 1.0, posing.model)
    return posing


@dataclass
class _Progress:
    """Progress of posing so many pictures, of which so many pairs are matched, for the user."""

    pictures: int
    pairs: int
    begin: float
    most: int = 0
    """Pictures that had a pose, at most: a model that is given up gives way to a smaller one."""

    def step(self, report: StageReport) -> ImportStep:
        done, of = report.done, self.pictures
        if report.stage is Stage.MATCHES:
            of = self.pairs
        elif report.stage is Stage.POSES:
            done = self.most = max(done, self.most)
        first, last = _BEGINS[report.stage], _ENDS[report.stage]
        share = first + (last - first) * done / max(of, 1)
        return ImportStep(_LABELS[report.stage].format(done, of), self.begin + (1 - self.begin) * share, report.model)


def _write(made: Reconstruction, size: tuple[int, int], names: Sequence[str], folder: Path) -> None:
    """Write a model as COLMAP's files."""
    lens, seen = made.model.lens, made.seen.only(made.counts)
    camera = ColmapCamera(1, "RADIAL", size, (lens.focal, *lens.center, lens.k1, lens.k2), str(folder))
    turns = so3.quaternion_from_matrix(torch.from_numpy(made.model.rotations)).tolist()
    places = made.model.translations.tolist()
    images = [
        ColmapImage(index + 1, names[index], 1, tuple(turns[index]), tuple(places[index]))
        for index in np.flatnonzero(made.posed).tolist()
    ]
    pixels, _ = made.model.project(seen.frame, seen.point)
    off, points = np.linalg.norm(pixels - seen.pixels, axis=1), []
    ends = np.flatnonzero(np.diff(seen.point, append=-1)) + 1
    for first, last in zip([0, *ends[:-1]], ends, strict=True):
        place = tuple(made.model.points[seen.point[first]].tolist())
        shown = tuple((seen.frame[first:last] + 1).tolist())
        points.append(ColmapPoint(place, float(off[first:last].mean()), shown))
    write_colmap(folder, [camera], images, points)


def _pack(posed: PosedPictures, folder: Path) -> bytes:
    """Pack the files of `folder`/sparse, and what is shown of them."""
    model, packed = posed.model, io.BytesIO()
    np.savez(folder / _SHOWN, poses=model.poses, points=model.points, found=[posed.features, posed.agreeing])
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in (folder / _SHOWN, *(path for path in (folder / "sparse").rglob("*") if path.is_file())):
            archive.write(path, path.relative_to(folder))
    return packed.getvalue()


def _unpack(kept: bytes, folder: Path) -> Posing:
    """Write the files that were packed into `folder`."""
    with zipfile.ZipFile(io.BytesIO(kept)) as archive:
        archive.extractall(folder)
    with np.load(folder / _SHOWN) as shown:
        features, agreeing = shown["found"].tolist()
        return Posing(SparseModel(shown["poses"], shown["points"]), features, agreeing)
