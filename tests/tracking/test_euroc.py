"""Folders in the ASL format."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import Camera
from nerfnav.inertial import ImuConfig, ImuNoise
from nerfnav.tracking import InertialMotion
from nerfnav.tracking.sources.euroc import is_euroc, open_euroc
from nerfnav.tracking.sources.pictures import FileSource
from tests.tracking.recordings import picture

SENSOR = """%YAML:1.0
sensor_type: camera
T_BS:
  cols: 4
  rows: 4
  data: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
rate_hz: 20
resolution: [32, 24]
camera_model: pinhole
intrinsics: [30.0, 31.0, 16.0, 12.0] #fu, fv, cu, cv
distortion_model: radial-tangential
distortion_coefficients: [-0.28, 0.07, 0.0002, 1.8e-05]
"""


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    camera, imu = tmp_path / "mav0" / "cam0", tmp_path / "mav0" / "imu0"
    (camera / "data").mkdir(parents=True)
    imu.mkdir()
    times = [1403636579763555584 + 50_000_000 * index for index in range(3)]
    for index, time in enumerate(times):
        assert cv2.imwrite(str(camera / "data" / f"{time}.png"), picture(index)[..., ::-1])
    lines = "".join(f"{time},{time}.png\r\n" for time in times)
    (camera / "data.csv").write_text(f"#timestamp [ns],filename\r\n{lines}")
    (camera / "sensor.yaml").write_text(SENSOR)
    lines = "".join(f"{times[0] + 5_000_000 * step},0.1,0.2,{step},0,0,9.81\n" for step in range(20))
    (imu / "data.csv").write_text(f"#timestamp [ns],w_RS_S_x [rad s^-1],...\n{lines}")
    return tmp_path


def opened(folder: Path) -> FileSource:
    return open_euroc(folder)


def test_pictures_camera_and_measurements_are_read(folder: Path) -> None:
    assert is_euroc(folder) and is_euroc(folder / "mav0") and not is_euroc(folder / "mav0" / "imu0")
    source = opened(folder)
    frames = list(source.frames())
    assert source.count == len(frames) == 3
    assert np.diff([frame.time for frame in frames]) == pytest.approx([0.05, 0.05], abs=1e-6)
    np.testing.assert_array_equal(frames[1].picture, picture(1))
    assert frames[0].name == "1403636579763555584.png"
    assert source.camera == Camera(32, 24, 30, 31, 16, 12, (-0.28, 0.07, 0.0002, 1.8e-05))
    assert source.inertial is not None
    np.testing.assert_allclose(source.inertial.times.diff(), 0.005, atol=1e-6)
    np.testing.assert_allclose(source.inertial.body_rates[7], [0.1, 0.2, 7], rtol=1e-6)
    np.testing.assert_allclose(source.inertial.specific_forces[7], [0, 0, 9.81], rtol=1e-6)


def test_without_sensor_and_imu_the_pictures_are_read_all_the_same(folder: Path) -> None:
    (folder / "mav0" / "cam0" / "sensor.yaml").unlink()
    (folder / "mav0" / "imu0" / "data.csv").unlink()
    source = opened(folder)
    assert source.camera is None and source.inertial is None and len(list(source.frames())) == 3


def test_another_camera_is_read_where_it_is_asked_for(folder: Path) -> None:
    (folder / "mav0" / "cam0").rename(folder / "mav0" / "cam1")
    assert len(list(open_euroc(folder, "cam1").frames())) == 3
    with pytest.raises(InvalidInputError, match="has no pictures in cam0; it has some in cam1"):
        opened(folder)


@pytest.mark.parametrize(
    ("file", "before", "after", "complaint"),
    [
        ("cam0/data.csv", "1403636579813555584,", "1403636579713555584,", "time must go on: 14036365798"),
        ("cam0/data.csv", "1403636579813555584,", "then,", "has 'then' where a number should be"),
        ("cam0/data.csv", "1403636579813555584,", "", "line 3 of .* has 1 columns, where 2 are needed"),
        ("cam0/data.csv", "1403636579813555584.png", "x.png", "the picture .*x.png cannot be read: No such file"),
        ("cam0/sensor.yaml", "intrinsics: [30.0, ", "intrinsics: [", "is no calibration of a camera"),
        ("cam0/sensor.yaml", "radial-tangential", "double-sphere", "the lens model 'double-sphere' is not known"),
        ("imu0/data.csv", "1403636579783555584,0.1", "1403636579783555584,nan", "has 'nan' where a number should be"),
        ("imu0/data.csv", "1403636579783555584,", "1403636578783555584,", "time must go on: measurement 4 of"),
        ("imu0/data.csv", ",0.1,0.2,4,0,0,9.81", ",0.1", "line 6 of .* has 2 columns, where 7 are needed"),
    ],
)
def test_bad_folders_are_told_in_one_sentence(folder: Path, file: str, before: str, after: str, complaint: str) -> None:
    path = folder / "mav0" / file
    assert before in path.read_text()
    path.write_text(path.read_text().replace(before, after, 1))
    with pytest.raises(InvalidInputError, match=complaint) as told:
        list(opened(folder).frames())
    assert "\n" not in str(told.value)


def test_a_grey_picture_and_one_that_is_cut_off_are_refused(folder: Path) -> None:
    data = folder / "mav0" / "cam0" / "data"
    first, second, _ = sorted(data.iterdir())
    cv2.imwrite(str(second), picture()[..., 0])
    frames = opened(folder).frames()
    next(frames)
    with pytest.raises(InvalidInputError, match="cannot be used: it is grey"):
        next(frames)
    first.write_bytes(first.read_bytes()[:50])
    with pytest.raises(InvalidInputError, match="no whole JPEG or PNG"):
        next(opened(folder).frames())


def test_the_cameras_mount_on_the_unit_is_read_from_both_sensors(folder: Path) -> None:
    camera, unit = (folder / "mav0" / name / "sensor.yaml" for name in ("cam0", "imu0"))
    told = opened(folder).inertial
    assert told is not None and told.mount is not None
    np.testing.assert_allclose(told.mount.rotation, np.diag([1, -1, -1]), atol=1e-6)
    matrices = "[0, -1, 0, 1, 1, 0, 0, 2, 0, 0, 1, 3, 0, 0, 0, 1]", "[1, 0, 0, 0.5, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]"
    camera.write_text(SENSOR.replace("[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]", matrices[0]))
    unit.write_text(f"%YAML:1.0\nT_BS:\n  data: {matrices[1]}\n")
    told = opened(folder).inertial
    assert told is not None and told.mount is not None
    np.testing.assert_allclose(told.mount.position, [0.5, 2, 3], atol=1e-6)
    np.testing.assert_allclose(told.mount.rotation, [[0, 1, 0], [1, 0, 0], [0, 0, -1]], atol=1e-6)
    camera.write_text(SENSOR.replace("T_BS", "T_SB"))
    told = opened(folder).inertial
    assert told is not None and told.mount is None


@pytest.mark.parametrize(
    ("data", "complaint"),
    [
        ("[1, 2, 3]", "T_BS is a list of 3, a list with a length of at least 16"),
        ("[2" + 15 * ", 0" + "]", "no turn and shift"),
    ],
)
def test_a_mount_that_is_none_is_told(folder: Path, data: str, complaint: str) -> None:
    file = folder / "mav0" / "cam0" / "sensor.yaml"
    file.write_text(SENSOR.replace("[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]", data))
    with pytest.raises(InvalidInputError, match=complaint):
        opened(folder)


NOISE = """%YAML:1.0
gyroscope_noise_density: 1.6968e-04     # [ rad / s / sqrt(Hz) ]
gyroscope_random_walk: 1.9393e-05
accelerometer_noise_density: 2e-3
"""


def test_the_noise_of_the_unit_is_used_as_far_as_its_file_tells_it(folder: Path) -> None:
    sensor = folder / "mav0" / "imu0" / "sensor.yaml"
    told = opened(folder).inertial
    assert told is not None and told.noise == ImuNoise()
    sensor.write_text(NOISE)
    told = opened(folder).inertial
    assert told is not None and told.noise == ImuNoise(gyro=1.6968e-4, accel=2e-3, gyro_walk=1.9393e-5)
    used = InertialMotion(told).config
    assert (used.gyro, used.accel, used.gyro_walk) == (1.6968e-4, 2e-3, 1.9393e-5)
    assert used.accel_walk == ImuConfig().accel_walk


@pytest.mark.parametrize(
    ("line", "complaint"),
    [
        ("gyroscope_noise_density: 0", "gyroscope_noise_density is 0, a number above 0 is needed"),
        ("accelerometer_noise_density: .nan", "accelerometer_noise_density is NaN, "),
        ("gyroscope_random_walk: -1.0e-5", "gyroscope_random_walk is -1e-05, a number at least 0 is needed"),
        ("accelerometer_random_walk: [3.0e-3]", "accelerometer_random_walk is a list of 1, a number is needed"),
    ],
)
def test_noise_that_cannot_be_is_told_in_one_sentence(folder: Path, line: str, complaint: str) -> None:
    (folder / "mav0" / "imu0" / "sensor.yaml").write_text(line + "\n")
    with pytest.raises(InvalidInputError, match=complaint):
        opened(folder)
