"""nerfnav localize: where in a field a picture was taken."""

from dataclasses import dataclass
from pathlib import Path

from tyro.conf import Positional

from nerfnav_app.cli.progress import run_and_print
from nerfnav_app.jobs.track.camera import GivenCamera
from nerfnav_app.jobs.track.localize import LocalizeRequest
from nerfnav_app.jobs.track.localize import run as run_job


@dataclass(frozen=True)
class Arguments:
    """Find the place that a picture was taken from, knowing nothing but the field and the camera."""

    field: Positional[str]
    """Path of a field file, or name of a bundled scene."""
    image: Positional[Path]
    """The picture, PNG or JPEG."""
    fov: float | None = None
    """Horizontal field of view of the camera [degrees]; by default that of the camera that the field was trained with,
    else the picture's EXIF, else 90."""
    intrinsics: tuple[float, float, float, float] | None = None
    """fx fy cx cy [pixels], in place of --fov."""
    camera: Path | None = None
    """Calibration of the camera by ROS, OpenCV, nerfstudio or COLMAP, in place of --fov and --intrinsics."""
    json: bool = False
    """Print one JSON object and nothing else."""


def run(arguments: Arguments) -> None:
    """Search, and print the likeliest poses."""
    request = LocalizeRequest(
        arguments.field, arguments.image, GivenCamera(arguments.camera, arguments.intrinsics, arguments.fov)
    )
    run_and_print(f"picture in {arguments.field}", run_job(request), arguments.json)
