"""Posing: run structure from motion in a process of its own, report its progress, and explain its failures."""

import io
import multiprocessing
import sqlite3
import zipfile
from collections.abc import Generator
from contextlib import closing, suppress
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

from nerfnav.core import cache
from nerfnav.importers.captures.pose_frames import (
    DATABASE,
    LOG,
    PosingFailure,
    Stage,
    StageReport,
    pair_frames,
    pose_frames,
)
from nerfnav.importers.captures.views import CaptureError
from nerfnav.importers.core.progress import ImportStep, SparseModel

_BEGINS = {Stage.FEATURES: 0.0, Stage.MATCHES: 0.35, Stage.POSES: 0.6}
_ENDS = {Stage.FEATURES: 0.35, Stage.MATCHES: 0.6, Stage.POSES: 1.0}
"""Shares of the time, measured with 50 frames of 360 x 640."""
_LABELS = {
    Stage.FEATURES: "finding features: {} of {} frames",
    Stage.MATCHES: "matching frames: {} of {} pairs",
    Stage.POSES: "{} of {} frames posed",
}
_BEAT_S = 0.5
_KIND, _SHOWN = "poses", "shown.npz"
"""Kind of cached files, and the file of the largest model in them."""
_MESSAGE = 200  # characters of COLMAP's message in errors
_AGREEING = 30
"""Features on which a pair of frames agrees that shows the same."""
_OVERLAPPING = 0.3
"""Share of such pairs in a video whose frames overlap."""
_DARK, _PLAIN = 45.0, 150
"""Brightness, 0 to 255, and features below which a frame is dark or plain."""


def estimate_poses(folder: Path, threads: int, begin: float = 0.0) -> Generator[ImportStep, None, SparseModel]:
    """Pose the pictures of `folder`/images into `folder`/sparse, and return the largest model.

    The same pictures are posed once on this machine, so that fields that are trained of them later have the same world.
    Progress goes from `begin` to 1. Closing the generator ends the process. Raises CaptureError where COLMAP breaks.
    """
    pictures = sorted((folder / "images").iterdir())
    names = [path.name for path in pictures]
    key = "\n".join(names).encode() + cache.hash_code(Path(__file__).with_name("pose_frames.py"), *pictures)
    if (kept := cache.load(_KIND, key)) is not None:
        model = _unpack(kept, folder)
    else:
        model = yield from _run_process(folder, names, threads, begin)
        if len(model.poses):
            cache.store(_KIND, key, _pack(model, folder))
    yield ImportStep(_LABELS[Stage.POSES].format(len(model.poses), len(names)), 1.0, model)
    return model


def _pack(model: SparseModel, folder: Path) -> bytes:
    """Models of COLMAP in `folder`/sparse, and the largest as it is shown, as a zip."""
    np.savez(folder / _SHOWN, poses=model.poses, points=model.points)
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in (folder / _SHOWN, *(path for path in (folder / "sparse").rglob("*") if path.is_file())):
            archive.write(path, path.relative_to(folder))
    return packed.getvalue()


def _unpack(kept: bytes, folder: Path) -> SparseModel:
    """Write the models that were packed into `folder`/sparse, and return the largest."""
    with zipfile.ZipFile(io.BytesIO(kept)) as archive:
        archive.extractall(folder)
    with np.load(folder / _SHOWN) as shown:
        return SparseModel(shown["poses"], shown["points"])


def _run_process(
    folder: Path, names: list[str], threads: int, begin: float
) -> Generator[ImportStep, None, SparseModel]:
    """Pose the pictures in a process, yield its progress, and return the largest model."""
    of = {Stage.FEATURES: len(names), Stage.MATCHES: len(list(pair_frames(names))), Stage.POSES: len(names)}
    context = multiprocessing.get_context("spawn")
    receiver, sender = context.Pipe(duplex=False)
    process = context.Process(target=pose_frames, args=(folder, threads, sender), daemon=True)
    process.start()
    sender.close()
    report = StageReport(Stage.FEATURES, 0)
    try:
        while True:
            first, last = _BEGINS[report.stage], _ENDS[report.stage]
            share = first + (last - first) * report.done / of[report.stage]
            label = _LABELS[report.stage].format(report.done, of[report.stage])
            yield ImportStep(label, begin + (1 - begin) * share, report.model)
            report = replace(report, model=None)
            message = _received(receiver, folder) if receiver.poll(_BEAT_S) else report
            if isinstance(message, SparseModel):
                return message
            # a model that is given up gives way to a smaller one
            report = replace(message, done=max(message.done, report.done if message.stage is report.stage else 0))
    finally:
        process.terminate()
        process.join()
        receiver.close()


def _received(receiver: Connection, folder: Path) -> StageReport | SparseModel:
    """Take the next message of the process. Raises CaptureError where it failed, or ended without one."""
    try:
        message = receiver.recv()
    except EOFError as error:
        raise CaptureError(f"structure from motion ended before it was done: {_last_line(folder / LOG)}") from error
    if isinstance(message, PosingFailure):
        raise CaptureError(f"structure from motion failed: {message.message.strip()[:_MESSAGE]}")
    return message


def _last_line(log: Path) -> str:
    lines = log.read_text("utf-8", "replace").split("\n") if log.is_file() else []
    return next((line.strip()[-_MESSAGE:] for line in reversed(lines) if line.strip()), "there is no message")


def _ask(folder: Path, query: str) -> float:
    """Answer of COLMAP's database, once its process has ended; 0 where there is none."""
    with (
        suppress(sqlite3.OperationalError),
        closing(sqlite3.connect(f"{(folder / DATABASE).resolve().as_uri()}?mode=ro", uri=True)) as database,
    ):
        return float(database.execute(query).fetchone()[0] or 0)
    return 0.0


def explain_failure(folder: Path, brightness: float) -> str:
    """Explain why frames have no poses, and what to film otherwise; `brightness` is their median, 0 to 255.

    Frames that were filmed from one place agree with each other like others, but nothing of theirs has a distance.
    """
    agreeing = _ask(folder, f"select avg(rows >= {_AGREEING}) from two_view_geometries")
    features = _ask(folder, "select avg(rows) from keypoints")
    if agreeing >= _OVERLAPPING:
        return (
            "its frames show the same things, but from one place: walk around the things that you film, rather than "
            "turn on the spot"
        )
    if brightness < _DARK:
        return f"it is dark, {brightness:.0f} of 255 in the middle: film with more light"
    if features < _PLAIN:
        return (
            f"its frames have {features:.0f} features each, {_PLAIN} are needed: film what has texture, in focus, with "
            "more light"
        )
    return (
        f"{agreeing:.0%} of its frames overlap with their neighbours: film more slowly, with more overlap and without "
        "jumps, while you walk around"
    )
