"""Processes that stand for structure from motion: each writes what it would, or fails as it would."""

import os
import sqlite3
import struct
import time
from collections.abc import Sequence
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np

from nerfnav.importers.captures.pose_frames import (
    DATABASE,
    LOG,
    PosingFailure,
    Stage,
    StageReport,
)
from nerfnav.importers.core.progress import SparseModel


def write_model(folder: Path, names: Sequence[str], size: tuple[int, int] = (160, 120)) -> None:
    """A model of COLMAP's whose cameras look along z and stand beside each other."""
    folder.mkdir(parents=True)
    width, height = size
    lens = struct.pack("<QiiQQ4d", 1, 1, 1, width, height, width, width, width / 2, height / 2)
    (folder / "cameras.bin").write_bytes(lens)
    images = struct.pack("<Q", len(names))
    for index, name in enumerate(names):
        images += struct.pack("<i7di", index, 1, 0, 0, 0, -0.1 * index, 0, 0, 1) + name.encode() + b"\0" + bytes(8)
    (folder / "images.bin").write_bytes(images)


def write_database(folder: Path, features: int, agreeing: Sequence[int]) -> None:
    """COLMAP's database of two frames with so many features each, and of pairs that agree on so many."""
    with sqlite3.connect(folder / DATABASE) as database:
        database.execute("create table keypoints (rows)")
        database.execute("create table two_view_geometries (rows)")
        database.executemany("insert into keypoints values (?)", 2 * [(features,)])
        database.executemany("insert into two_view_geometries values (?)", [(rows,) for rows in agreeing])


def sparse(count: int, points: int = 100) -> SparseModel:
    poses = np.tile(np.eye(4), (count, 1, 1))
    poses[:, 0, 3] = 0.1 * np.arange(count)
    return SparseModel(poses, np.random.default_rng(0).uniform(-1, 1, (points, 3)) - np.array([0, 0, 3.0]))


def _names(folder: Path) -> list[str]:
    return sorted(path.name for path in (folder / "images").iterdir())


def pose_all(folder: Path, threads: int, sender: Connection) -> None:
    """Poses are found for all frames but the last two, after a first try that finds fewer."""
    names = _names(folder)
    sender.send(StageReport(Stage.FEATURES, 0))
    sender.send(StageReport(Stage.MATCHES, 8 * threads // threads))
    for posed in (4, 2, len(names) - 2):
        sender.send(StageReport(Stage.POSES, posed, sparse(posed)))
    write_model(folder / "sparse" / "0", names[:3])
    write_model(folder / "sparse" / "1", names[:-2])
    sender.send(sparse(len(names) - 2))


def pose_few(folder: Path, threads: int, sender: Connection) -> None:
    """Poses are found for two frames, of many that agree with each other."""
    write_database(folder, 900, [200, 150, 20])
    write_model(folder / "sparse" / "0", _names(folder)[:2])
    sender.send(sparse(2))


def pose_by_chance(folder: Path, threads: int, sender: Connection) -> None:
    """Poses are found for all frames by ten points."""
    write_database(folder, 60, [10, 15, 20])
    sender.send(sparse(len(_names(folder)), points=10))


def fail(folder: Path, threads: int, sender: Connection) -> None:
    """COLMAP raises an error."""
    sender.send(PosingFailure("database is locked"))


def abort(folder: Path, threads: int, sender: Connection) -> None:
    """COLMAP aborts, as it does where a check of its own fails."""
    (folder / LOG).write_text("...\nF1126 mapper.cc:73] Check failed: num > 0\n\n")
    os._exit(3)


def wait(folder: Path, threads: int, sender: Connection) -> None:
    """COLMAP works for long."""
    (folder / "process").write_text(str(os.getpid()))
    time.sleep(60)
