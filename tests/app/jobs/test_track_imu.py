"""`nerfnav track --imu`, on an EuRoC folder of a camera that is shaken before a small place."""

import json
import re
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from nerfnav.field import save_field
from nerfnav_app.cli.main import main
from tests.export.readers import poses_of_tum
from tests.tracking.shaken import BIASES, MOUNT, Shaken
from tests.tracking.walks import CAMERA, every, field

SHAKEN = Shaken(turning=0.4, turns=1.8)
TIMES = every(8, dt=0.2, first=1.0)


@pytest.fixture(scope="module")
def place(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("track") / "balls.npz"
    save_field(replace(field(), info=replace(field().info, noise_std=0.01)), path)
    return path


@pytest.fixture
def recording(tmp_path: Path) -> Path:
    camera, unit = tmp_path / "mav0" / "cam0", tmp_path / "mav0" / "imu0"
    (camera / "data").mkdir(parents=True)
    unit.mkdir()
    rows = []
    for frame in SHAKEN.frames(TIMES):
        rows.append(f"{round(1e9 * frame.time)},{frame.time:.3f}.png\n")
        assert cv2.imwrite(str(camera / "data" / f"{frame.time:.3f}.png"), frame.picture.numpy()[..., ::-1])
    (camera / "data.csv").write_text("#timestamp [ns],filename\n" + "".join(rows))
    mount = np.eye(4)
    mount[:3, :3], mount[:3, 3] = MOUNT.rotation.numpy() * (1, -1, -1), MOUNT.position
    (camera / "sensor.yaml").write_text(
        f"T_BS:\n  data: {mount.ravel().tolist()}\nresolution: [{CAMERA.width}, {CAMERA.height}]\n"
        f"intrinsics: [{CAMERA.fx}, {CAMERA.fy}, {CAMERA.cx}, {CAMERA.cy}]\n"
    )
    reported = SHAKEN.measured(2.6)
    numbers = np.c_[reported.body_rates, reported.specific_forces]
    lines = [f"{round(1e9 * time)},{','.join(map(str, row))}\n"
             for time, row in zip(reported.times.tolist(), numbers, strict=True) if time > 0.5]  # fmt: skip
    (unit / "data.csv").write_text("".join(lines))
    return tmp_path


@pytest.mark.slow
def test_quick_turns_are_followed_by_what_the_unit_says(
    place: Path, recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    words = ["track", str(place), str(recording), "--out", str(out), "--imu", "--no-pictures", "--json"]
    assert main(words) == 0
    reported = json.loads(capsys.readouterr().out.splitlines()[-1])
    assert (reported["updated"], reported["lost"], reported["found_again"]) == (8, 0, 0)
    np.testing.assert_allclose(reported["gyro_bias_radps"], BIASES[:3], atol=0.01)
    assert len(reported["accel_bias_std_mps2"]) == 3
    times, positions, _ = poses_of_tum((out / "trajectory.tum").read_text())
    for time, position in zip(times.tolist(), positions, strict=True):
        assert np.linalg.norm(position - SHAKEN.pose(time).position) < 0.01


def _without_unit(mav: Path) -> None:
    (mav / "imu0" / "data.csv").unlink()


def _without_mount(mav: Path) -> None:
    sensor = mav / "cam0" / "sensor.yaml"
    sensor.write_text(sensor.read_text().replace("T_BS", "T_SB"))


def _of_another_day(mav: Path) -> None:
    table = mav / "imu0" / "data.csv"
    table.write_text("".join(f"9{line}" for line in table.read_text().splitlines(keepends=True)))


@pytest.mark.parametrize(
    ("spoil", "words", "complaint"),
    [
        (_without_unit, ["--imu"], "has no inertial measurements: --imu takes an MCAP"),
        (_without_mount, ["--imu"], "does not say how the camera is mounted .* give --imu-mount x y z"),
        (_without_mount, ["--imu-mount", *"0001100"], "a quaternion of length 1, not 1.41421"),
        (_without_mount, ["--imu-mount", "1", "2", "3"], "imu-mount takes 7 numbers, not 3"),
        (_without_mount, ["--imu-mount", *"000000", "one"], "imu-mount is made of numbers, not of .0 0 0 0 0 0 one."),
        (_of_another_day, ["--imu"], "the first picture was taken at 1.000 s, and the inertial measurements are from"),
    ],
)
def test_what_cannot_lead_is_told_in_one_sentence(
    spoil: Callable[[Path], None],
    words: list[str],
    complaint: str,
    place: Path,
    recording: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    spoil(recording / "mav0")
    assert main(["track", str(place), str(recording), "--out", str(recording / "out"), *words, "--json"]) == 2
    reported = capsys.readouterr().err.strip()
    assert "\n" not in reported and re.search(complaint, reported)
