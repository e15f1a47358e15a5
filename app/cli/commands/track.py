"""nerfnav track: where a camera was while it took pictures."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional

from nerfnav.tracking import SourceOptions
from nerfnav_app.cli.number_arguments import numbers_argument
from nerfnav_app.cli.progress import run_and_print
from nerfnav_app.jobs.track.camera import GivenCamera
from nerfnav_app.jobs.track.camera_run import CameraRun
from nerfnav_app.jobs.track.imu import GivenImu
from nerfnav_app.jobs.track.track import TrackRequest
from nerfnav_app.jobs.track.track import run as run_job

Mount = Annotated[tuple[float, ...] | None, numbers_argument("imu-mount", "X Y Z QX QY QZ QW")]


@dataclass(frozen=True)
class Arguments:
    """Track a camera through a field, knowing nothing at first: a trajectory, covariances, an overlay video, MCAP."""

    field: Positional[str]
    """Path of a field file, or name of a bundled scene."""
    source: Positional[Path]
    """A video; an MCAP file or rosbag2; an EuRoC folder; or a folder of pictures with times: rgb.txt (TUM), names that
    are times in s or ns, a capture."""
    out: Path
    """Folder for trajectory.tum, poses.csv, overlay.mp4 and track.mcap."""
    camera: Path | None = None
    """Calibration of the camera by ROS, OpenCV, nerfstudio or COLMAP; by default what the source says, else the camera
    that the field was trained with, else 90 degrees."""
    fov: float | None = None
    """Horizontal field of view of the camera [degrees], in place of --camera."""
    fps: float | None = None
    """Pictures in a second, for sources that tell no times."""
    topic: str | None = None
    """Name of the pictures that are meant, where a recording has several: a topic, or cam1 of an EuRoC folder."""
    imu: bool = False
    """Let the source's inertial measurements (sensor_msgs/Imu, imu0) lead from picture to picture, in a field in
    metres whose z axis is up: quick turns are followed at few pictures in a second."""
    imu_mount: Mount = None
    """How the camera is mounted on the unit, where the source does not say: x y z [m] qx qy qz qw of T_imu_camera, the
    camera x right, y down, z ahead. Means --imu."""
    pictures: bool = True
    """Write overlay.mp4 and track.mcap, too (the latter needs the extra [ros])."""
    json: bool = False
    """Print one JSON object and nothing else."""


def run(arguments: Arguments) -> None:
    """Track, and print what became of the frames."""
    camera = CameraRun(
        arguments.source,
        GivenCamera(arguments.camera, fov_deg=arguments.fov),
        SourceOptions(arguments.fps, arguments.topic),
        GivenImu(arguments.imu_mount) if arguments.imu or arguments.imu_mount is not None else None,
    )
    request = TrackRequest(arguments.field, camera, arguments.out, arguments.pictures)
    run_and_print(f"{arguments.source} in {arguments.field}", run_job(request), arguments.json)
