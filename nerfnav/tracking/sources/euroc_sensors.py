"""What sensor.yaml tells of the sensors of a folder in the ASL format: lens, mount, noise."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from nerfnav.errors import InvalidInputError
from nerfnav.geometry import Camera, Pose, camera_of_matrices
from nerfnav.tracking.frame import ImuNoise, mount_of

_MODELS = {"radial-tangential": "plumb_bob", "equidistant": "equidistant"}
"""Lens models to the words of ROS."""
_HEADING = "%YAML:1.0"
"""OpenCV's first line, which is no YAML."""
_NOISE = {
    "gyro": "gyroscope_noise_density", "accel": "accelerometer_noise_density",
    "gyro_walk": "gyroscope_random_walk", "accel_walk": "accelerometer_random_walk",
}  # fmt: skip
"""What a unit's file calls its noise."""


def camera_of(file: Path) -> Camera | None:
    """The camera that a file tells; None where there is none. Raises InvalidInputError where it is no calibration."""
    if not file.is_file():
        return None
    try:
        told = _parsed(file)
        fx, fy, cx, cy = map(float, told["intrinsics"])
        model = str(told.get("distortion_model", ""))
        width, height = told["resolution"]
        return camera_of_matrices({
            "image_width": width, "image_height": height, "camera_matrix": [fx, 0, cx, 0, fy, cy, 0, 0, 1],
            "distortion_model": _MODELS.get(model, model),
            "distortion_coefficients": told.get("distortion_coefficients"),
        })  # fmt: skip
    except (OSError, KeyError, TypeError, ValueError, AttributeError, yaml.YAMLError, InvalidInputError) as error:
        raise InvalidInputError(f"{file} is no calibration of a camera: {' '.join(str(error).split())}") from error


def mount_between(unit: Path, camera: Path) -> Pose | None:
    """T_imu_camera, where the camera's file says how that is mounted."""
    on_body = _on_body(camera / "sensor.yaml")
    if on_body is None:
        return None
    back = _on_body(unit / "sensor.yaml")
    return mount_of(on_body if back is None else np.linalg.inv(back) @ on_body)


def _on_body(file: Path) -> np.ndarray | None:
    """T_BS of a sensor; None where nothing is said of it. Raises InvalidInputError where it is no motion."""
    told = _told(file) if file.is_file() else {}
    if "T_BS" not in told:
        return None
    try:
        matrix = np.array(told["T_BS"]["data"], dtype=np.float64).reshape(4, 4)
    except (KeyError, TypeError, ValueError) as error:
        raise InvalidInputError(f"{file} tells no T_BS of 16 numbers") from error
    if not (np.isfinite(matrix).all() and np.allclose(matrix[:3, :3] @ matrix[:3, :3].T, np.eye(3), atol=1e-3)):
        raise InvalidInputError(f"{file} tells a T_BS that is no turn and shift")
    return matrix


def noise_of(file: Path) -> ImuNoise:
    """What a unit's file tells of its noise. Raises InvalidInputError where that cannot be."""
    told = _told(file) if file.is_file() else {}
    return ImuNoise(**{ours: _density(file, theirs, told[theirs]) for ours, theirs in _NOISE.items() if theirs in told})


def _density(file: Path, name: str, value: object) -> float:
    """A spectral density. A bias may stand still, but no measurement is without noise."""
    try:
        density = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        density = math.nan
    still = name.endswith("_random_walk")
    if not (0 < density < math.inf or (still and density == 0)):
        least = "at least 0" if still else "more than 0"
        raise InvalidInputError(f"{name} in {file} is a finite number of {least}, not {value!r}")
    return density


def _parsed(file: Path) -> Any:
    """The YAML of a sensor's file, whose heading parsers do not know."""
    return yaml.safe_load(file.read_text().removeprefix(_HEADING))


def _told(file: Path) -> dict[str, Any]:
    """What a sensor's file tells. Raises InvalidInputError where it cannot be read."""
    try:
        told = _parsed(file)
    except (OSError, UnicodeDecodeError, yaml.YAMLError) as error:
        raise InvalidInputError(f"{file} cannot be read: {' '.join(str(error).split())}") from error
    return told if isinstance(told, dict) else {}
