"""Tracking as a job and as a command, on pictures of a small place along a known way."""

import csv
import json
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import cv2
import pytest
import torch

from nerfnav.export.track import OPENCV
from nerfnav.field import save_field
from nerfnav.formats import read_camera
from nerfnav.geometry import Camera, so3
from nerfnav.geometry.similarity import Similarity
from nerfnav_app.cli.main import main
from tests.export.readers import poses_of_tum
from tests.tracking.walks import CAMERA, DT, every, field, pose, walk

PLACED = Similarity(so3.exp(torch.tensor([0.3, -0.2, 0.5]).double()), torch.tensor([1.0, 2.0, 3.0]).double(), 2.0)
"""A capture in units of 2 m."""


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("track") / "balls.npz"
    info = replace(field().info, noise_std=0.01, placed=PLACED.numbers, camera=CAMERA.numbers)
    save_field(replace(field(), info=info), path)
    return path


def folder(path: Path, times: Sequence[float], camera: Camera = CAMERA) -> Path:
    """Pictures named by their times."""
    path.mkdir()
    for frame in walk(times, camera):
        cv2.imwrite(str(path / f"{frame.time:.6f}.png"), frame.picture.numpy()[..., ::-1])
    return path


def film(path: Path, count: int, camera: Camera) -> Path:
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"mp4v"), 1 / DT, (camera.width, camera.height))
    for frame in walk(every(count), camera):
        writer.write(frame.picture.numpy()[..., ::-1].copy())
    writer.release()
    return path


def tracked(place: Path, source: Path, out: Path, capsys: pytest.CaptureFixture[str]) -> dict[str, object]:
    assert main(["track", str(place), str(source), "--out", str(out), "--json"]) == 0
    return json.loads(capsys.readouterr().out.splitlines()[-1])


def largest_errors(out: Path) -> tuple[float, float]:
    """Position [m] and attitude [rad] against the way, in the capture's own frame."""
    times, positions, quaternions = poses_of_tum((out / "trajectory.tum").read_text())
    moved, turned = [], []
    for time, position, quaternion in zip(times.tolist(), positions, quaternions, strict=True):
        true = PLACED.inverted().pose(pose(time))
        moved.append(PLACED.scale * float((position - true.position.double()).norm()))
        found = so3.matrix_from_quaternion(quaternion)
        turned.append(float(so3.local(true.rotation.double() @ OPENCV.double(), found).norm()))
    return max(moved), max(turned)


@pytest.mark.slow
def test_a_folder_becomes_a_trajectory_in_the_captures_own_frame(
    place: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source, out = folder(tmp_path / "in", every(8)), tmp_path / "out"
    reported = tracked(place, source, out, capsys)
    assert (reported["frames"], reported["updated"], reported["lost"], reported["found_again"]) == (8, 8, 0, 0)
    moved, turned = largest_errors(out)
    assert moved < 0.02 and turned < 0.02
    rows = list(csv.DictReader((out / "poses.csv").read_text().splitlines()))
    assert [row["status"] for row in rows] == ["found", *["followed"] * 7]
    assert all(float(row["cov_x_x_m.m"]) > 0 for row in rows)


@pytest.mark.slow
def test_a_video_of_another_size_is_tracked_and_shown(
    place: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source, out = film(tmp_path / "film.mp4", 8, CAMERA.scaled(2)), tmp_path / "out"
    reported = tracked(place, source, out, capsys)
    assert reported["frames"] == 8 and reported["updated"] == 8
    assert largest_errors(out)[0] < 0.04  # an MPEG-4 file loses detail
    reader = cv2.VideoCapture(str(out / "overlay.mp4"))
    assert int(reader.get(cv2.CAP_PROP_FRAME_COUNT)) == 8
    assert int(reader.get(cv2.CAP_PROP_FRAME_WIDTH)) == 3 * CAMERA.width * 2


@pytest.mark.slow
def test_the_recording_is_read_by_a_foreign_reader(
    place: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    reader = pytest.importorskip("mcap_ros2.reader", reason="mcap-ros2-support reads MCAP")
    out = tmp_path / "out"
    tracked(place, folder(tmp_path / "in", every(4)), out, capsys)
    messages = [(view.channel.topic, view.ros_msg) for view in reader.read_ros2_messages(str(out / "track.mcap"))]
    names = [topic for topic, _ in messages]
    assert names.count("/pose") == names.count("/picture") == names.count("/field_picture") == 4
    stamped = next(message for topic, message in messages if topic == "/pose")
    assert len(stamped.pose.covariance) == 36 and stamped.pose.covariance[0] > 0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "complaint"), [("gone", "there is no"), ("empty", "no pictures"), ("backwards", "time must go on")]
)
def test_what_cannot_be_tracked_is_one_sentence(
    name: str, complaint: str, place: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = tmp_path / name
    if name == "empty":
        source.mkdir()
    if name == "backwards":
        files = sorted(folder(source, every(2)).iterdir())
        (source / "rgb.txt").write_text(f"1.0 {files[0].name}\n0.5 {files[1].name}\n")
    assert main(["track", str(place), str(source), "--out", str(tmp_path / "out"), "--json"]) == 2
    reported = capsys.readouterr().err.strip()
    assert complaint in reported and "\n" not in reported


@pytest.mark.slow
def test_pictures_whose_shape_changes_end_the_track_and_what_was_tracked_is_kept(
    place: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source, out = folder(tmp_path / "in", every(3)), tmp_path / "out"
    cv2.imwrite(str(source / "9.0.png"), walk([1.0], CAMERA.resized(96, 120))[0].picture.numpy())
    assert main(["track", str(place), str(source), "--out", str(out), "--json"]) == 2
    reported = capsys.readouterr().err
    assert "same proportions" in reported and "what was tracked until then" in reported
    assert len((out / "trajectory.tum").read_text().splitlines()) == 4


@pytest.mark.slow
@pytest.mark.parametrize(("fov", "ok"), [(80, True), (73, False)])
def test_a_wrong_field_of_view_is_corrected_and_the_camera_that_fits_is_written(
    fov: int, ok: bool, place: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source, fitted = folder(tmp_path / "in", every(8)), tmp_path / "fitted.json"
    words = ["track", str(place), str(source), "--out", str(tmp_path / "out"), "--json", "--no-pictures"]
    assert main([*words, "--fov", str(fov), "--fit-camera", str(fitted)]) == 0
    reported = json.loads(capsys.readouterr().out.splitlines()[-1])
    check = reported["camera_check"]
    assert check["ok"] == ok and check["given_fov_deg"] == pytest.approx(fov)
    assert check["fitted_fov_deg"] == pytest.approx(80, abs=1)
    assert ("80.0 degrees, not 73.0 as given; it was corrected" in reported["camera"]) != ok
    assert reported["updated"] == 8 and largest_errors(tmp_path / "out")[0] < 0.02
    assert read_camera(fitted).horizontal_fov_deg == pytest.approx(80, abs=1)


@pytest.mark.parametrize(("count", "name", "complaint"), [(3, "c.json", "has 3"), (4, "c.yaml", "ends in .json")])
def test_a_camera_is_fitted_to_four_pictures_at_least_and_written_as_json(
    count: int, name: str, complaint: str, place: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    source = folder(tmp_path / "in", every(count))
    words = ["track", str(place), str(source), "--out", str(tmp_path / "out"), "--fit-camera", str(tmp_path / name)]
    assert main([*words, "--json"]) == 2
    reported = capsys.readouterr().err.strip()
    assert complaint in reported and "\n" not in reported
