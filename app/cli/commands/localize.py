"""nerfnav localize: global localization of a picture in a field."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional, arg

from nerfnav_app.cli.progress import run_and_print
from nerfnav_app.cli.terminal import Output
from nerfnav_app.jobs.track.camera import GivenCamera
from nerfnav_app.jobs.track.localize import LocalizeRequest
from nerfnav_app.jobs.track.localize import run as run_job


@dataclass(frozen=True)
class Arguments(Output):
    """Find the pose from which a picture was taken, from the field and the camera alone."""

    field: Positional[str]
    """Path of a field file, or name of a bundled scene."""
    image: Positional[Path]
    """Picture, PNG or JPEG."""
    fov: float | None = None
    """Horizontal field of view of the camera [degrees] (default: by the camera of the field, else by EXIF, else 90)."""
    intrinsics: Annotated[tuple[float, float, float, float] | None, arg(metavar="FX FY CX CY")] = None
    """Intrinsics [pixels], in place of --fov."""
    camera: Path | None = None
    """Calibration of the camera by ROS, OpenCV, Kalibr, EuRoC, nerfstudio or COLMAP, in place of --fov and
    --intrinsics."""


def run(arguments: Arguments) -> None:
    """Search, and print the likeliest poses."""
    request = LocalizeRequest(
        arguments.field, arguments.image, GivenCamera(arguments.camera, arguments.intrinsics, arguments.fov)
    )
    run_and_print(f"picture in {arguments.field}", run_job(request), arguments.json)
