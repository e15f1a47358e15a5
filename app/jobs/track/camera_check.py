"""Camera check for users: its numbers, the refusal of a wrong camera, the calibration file of the one that fits."""

from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any

from nerfnav.core.errors import InvalidInputError
from nerfnav.formats import format_camera
from nerfnav.geometry import Camera
from nerfnav.tracking import CameraCheckConfig, CameraFit, FrameSource
from nerfnav_app.storage.output_files import prepare_file, write_text


def require_clear(fit: CameraFit) -> None:
    """Raise InvalidInputError where a wrong camera cannot be corrected."""
    if not fit.clear:
        raise InvalidInputError(
            f"the camera's field of view of {fit.given.horizontal_fov_deg:.1f} degrees does not fit the field, and "
            f"{fit.fitted.horizontal_fov_deg:.1f} degrees fits better, but not clearly: give a calibration by --camera"
        )


def numbers_of_check(fit: CameraFit | None, camera: Camera) -> dict[str, Any]:
    """Return the numbers of `camera_check`; None stands for what is unknown, where the camera was not found."""
    unknown = {"ok": None, "given_fov_deg": camera.horizontal_fov_deg, "fitted_fov_deg": None}
    return unknown if fit is None else fit.numbers


@dataclass(frozen=True)
class CalibrationFile:
    """Calibration file for the camera that fits."""

    path: Path
    """JSON, as `--camera` reads it."""

    def prepare(self) -> None:
        """Raise NerfnavError where the file cannot be written."""
        if self.path.suffix.lower() != ".json":
            raise InvalidInputError(
                f"--fit-camera writes a calibration in JSON: give a name that ends in .json, not {self.path}"
            )
        prepare_file(self.path)

    def require_pictures(self, source: FrameSource, name: Path) -> None:
        """Raise InvalidInputError where a source has too few pictures to fit a camera."""
        fewest = CameraCheckConfig.fewest
        count = sum(1 for _ in islice(source.frames(), fewest))
        if count < fewest:
            raise InvalidInputError(f"--fit-camera needs {fewest} pictures or more, and {name} has {count}")

    def write(self, fit: CameraFit | None) -> None:
        """Write the camera that fits. Raises InvalidInputError where too few pictures show it, or not clearly."""
        fewest, found = CameraCheckConfig.fewest, 0 if fit is None else fit.pictures
        if fit is None or found < fewest:
            raise InvalidInputError(
                f"--fit-camera needs {fewest} pictures or more whose pose is found, and found {found} of the first "
                f"{CameraCheckConfig.frames}: give pictures that show more of the field"
            )
        require_clear(fit)
        write_text(self.path, format_camera(fit.fitted))
