"""nerfnav track: track a camera through a field."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from nerfnav.tracking import SourceOptions
from nerfnav_app.cli.arguments import numbers_argument
from nerfnav_app.cli.progress import run_and_print
from nerfnav_app.cli.terminal import Output
from nerfnav_app.jobs.track.camera import GivenCamera
from nerfnav_app.jobs.track.camera_check import CalibrationFile
from nerfnav_app.jobs.track.camera_run import CameraRun
from nerfnav_app.jobs.track.imu import GivenImu
from nerfnav_app.jobs.track.track import TrackRequest
from nerfnav_app.jobs.track.track import run as run_job

Mount = Annotated[tuple[float, ...] | None, numbers_argument("imu-mount", "X Y Z QX QY QZ QW")]


@dataclass(frozen=True)
class Arguments(Output):
    """Track a camera through a field, from an unknown pose: trajectory, covariances, overlay video, MCAP."""

    field: Positional[str]
    """Path of a field file, or name of a bundled scene."""
    source: Positional[Path]
    """Video, MCAP file, rosbag2, EuRoC folder, or folder of pictures with times. A folder has rgb.txt (TUM), file names
    that are times in s or ns, or is a capture."""
    out: Path
    """Folder for trajectory.tum, poses.csv, overlay.mp4 and track.mcap."""
    camera: Path | None = None
    """Calibration of the camera by ROS, OpenCV, Kalibr, EuRoC, nerfstudio or COLMAP (default: that of the source, else
    the field's own camera, else 90 degrees)."""
    fov: float | None = None
    """Horizontal field of view of the camera [degrees], in place of --camera."""
    fps: float | None = None
    """Pictures in a second, for sources without times."""
    topic: str | None = None
    """Topic of the pictures, where a recording has several; or cam1 of an EuRoC folder."""
    imu: bool = False
    """Predict from picture to picture by the inertial measurements of the source (sensor_msgs/Imu, imu0). It follows
    quick turns at few pictures in a second. The field must be in metres, with its z axis up."""
    imu_mount: Mount = None
    """Pose T_imu_camera of the camera on the unit [m], if the source does not give it. The camera is x right, y down, z
    ahead. Implies --imu."""
    fit_camera: Annotated[Path | None, arg(metavar="FILE.json")] = None
    """File for the calibration that fits the field best, for --camera. It takes four pictures or more."""
    pictures: bool = True
    """Write overlay.mp4 and track.mcap, too (the latter needs the extra [ros])."""


def run(arguments: Arguments) -> None:
    """Track, and print the status of the frames."""
    camera = CameraRun(
        arguments.source,
        GivenCamera(arguments.camera, fov_deg=arguments.fov),
        SourceOptions(arguments.fps, arguments.topic),
        GivenImu(arguments.imu_mount) if arguments.imu or arguments.imu_mount is not None else None,
        None if arguments.fit_camera is None else CalibrationFile(arguments.fit_camera),
    )
    request = TrackRequest(arguments.field, camera, arguments.out, arguments.pictures)
    run_and_print(f"{arguments.source} in {arguments.field}", run_job(request), arguments.json)
