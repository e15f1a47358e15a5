"""Calibrations of one camera or several, in YAML, JSON or XML, by the names of several programs.

    ROS's calibrations      image_width, image_height, camera_matrix, distortion_model, distortion_coefficients
    ROS's camera_info       width, height, K, D, P, distortion_model, binning_x, binning_y, roi; also as `rostopic echo`
                            prints it, and as a message of a bag
    OpenCV's FileStorage    image_width, image_height, camera_matrix, distortion_coefficients, fisheye_model
    Kalibr's camchain       cam0, cam1, ...: resolution, intrinsics, camera_model, distortion_model, distortion_coeffs
    EuRoC's sensor.yaml     resolution, intrinsics, camera_model, distortion_model, distortion_coefficients

A matrix is a list, a list of lists, or has its numbers as `data`. Names count without case and underscores. Models:
none, Brown's (plumb_bob, radtan) and Kannala and Brandt's (equidistant, fisheye).
"""

import math
import xml.etree.ElementTree as ElementTree
from pathlib import Path
from typing import Annotated, Any

import msgspec
import yaml
from msgspec import Meta

from nerfnav.core.errors import InvalidInputError
from nerfnav.formats.record import LARGEST, Number, Pixels, convert_record, parse_json, parse_yaml, printable, read_text
from nerfnav.geometry import Camera

Entries = dict[str, Any]
"""Keys of a file with their values."""
_FISHEYE = ("equidistant", "fisheye", "opencv_fisheye", "kannala_brandt")
_BROWN = ("plumb_bob", "radtan", "radial_tangential", "rational_polynomial", "brown", "brown_conrady", "opencv",
          "radial", "simple_radial", "full_opencv")  # fmt: skip
_NO_LENS = ("", "none", "pinhole", "simple_pinhole", "perspective")
_SQUARE = 1e-3
"""Largest skew, and largest number in place of a 0, of a camera matrix, in focal lengths."""
_WHOLE = Annotated[float, Meta(ge=0, lt=2**32, multiple_of=1)]


class Region(msgspec.Struct, frozen=True):
    """Region of interest of a sensor, in its own pixels before binning; all 0 is the whole sensor."""

    x_offset: _WHOLE = 0.0
    y_offset: _WHOLE = 0.0
    width: _WHOLE = 0.0
    height: _WHOLE = 0.0


_FIELDS: dict[str, tuple[Any, tuple[str, ...]]] = {
    "width": (Pixels, ("imagewidth", "width", "w")),
    "height": (Pixels, ("imageheight", "height", "h")),
    "resolution": (Annotated[list[Pixels], Meta(min_length=2, max_length=2)], ("resolution", "imagesize")),
    "matrix": (list[Number], ("cameramatrix", "k", "intrinsicmatrix", "mtx")),
    "intrinsics": (list[Number], ("intrinsics",)),
    "projection": (list[Number], ("projectionmatrix", "p")),
    "coefficients": (list[Number], ("distortioncoefficients", "distortioncoeffs", "distcoeffs", "dist", "d")),
    "distortion_model": (str, ("distortionmodel",)),
    "camera_model": (str, ("cameramodel",)),
    "fisheye": (bool | float, ("fisheyemodel", "isfisheye", "fisheye")),
    "binning_x": (_WHOLE, ("binningx",)),
    "binning_y": (_WHOLE, ("binningy",)),
    "roi": (Region, ("roi",)),
}
"""Type of each entry that is read, and its names without case and underscores."""
_LISTS = ("matrix", "projection", "coefficients", "intrinsics", "resolution")


class _Loader(yaml.SafeLoader):
    """Reads the matrices of OpenCV as the maps that they are."""


def _construct_map(loader: yaml.SafeLoader, _: str, node: yaml.Node) -> Any:
    return loader.construct_mapping(node, deep=True) if isinstance(node, yaml.MappingNode) else None


_Loader.add_multi_constructor("tag:yaml.org,2002:opencv-", _construct_map)


def read_entries(path: Path) -> list[Entries]:
    """Read the documents of a file of YAML, JSON or XML that hold keys with values.

    Raises InvalidInputError for a file that cannot be read, and for one without any.
    """
    text = read_text(path).lstrip()
    if text.startswith("<"):
        documents = [_parse_xml(text, path)]
    elif path.suffix.lower() == ".json":
        documents = [parse_json(text, path)]
    else:
        # OpenCV's first line (%YAML:1.0) is a directive that no parser knows
        lines = ("" if line.startswith("%YAML") else line for line in text.splitlines())
        documents = parse_yaml("\n".join(lines), path, _Loader)
    found = [document for document in documents if isinstance(document, dict)]
    if not found:
        raise InvalidInputError(f"{path} holds no names with values")
    return found


def _parse_xml(text: str, path: Path) -> Any:
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise InvalidInputError(f"{path} is XML that defines entities: a calibration by OpenCV has none")
    try:
        return _plain(ElementTree.fromstring(text.encode()))
    except (ElementTree.ParseError, RecursionError) as error:
        raise InvalidInputError(f"{path} is not readable as XML: {error}") from error


def _plain(element: ElementTree.Element) -> Any:
    """An element as a map of its children, as a list of numbers and words, or as the only one of them."""
    if len(element):
        return {child.tag: _plain(child) for child in element}
    words = [_number_or_word(word) for word in (element.text or "").strip().strip('"').split()]
    return words[0] if len(words) == 1 and element.tag != "data" else words


def _number_or_word(word: str) -> float | str:
    try:
        return float(word)
    except ValueError:
        return word


def list_cameras(documents: list[Entries]) -> dict[str, Entries]:
    """Entries of each camera in the documents of a file by its name, which is "" for a camera without one.

    Cameras without a name that say the same are one: messages of a topic are printed again and again.
    """
    named: dict[str, Entries] = {}
    for document in documents:
        chain = {str(key): value for key, value in document.items() if _is_named_camera(value)}
        named.update(chain or {"" if not named else str(len(named)): document})
    cameras = {name: {key: value for key, value in entries.items() if _known(key)} for name, entries in named.items()}
    first = next(iter(cameras))
    alike = first == "" and all(entries == cameras[first] or not entries for entries in cameras.values())
    return {"": cameras[first]} if alike else cameras


def _is_named_camera(value: Any) -> bool:
    """Return True for the entries of a camera in a chain."""
    return isinstance(value, dict) and any(_known(key) in ("intrinsics", "matrix") for key in value)


def _known(key: object) -> str | None:
    """The field that a key belongs to; None where there is none."""
    plain = key.replace("_", "").lower() if isinstance(key, str) else None
    return next((field for field, (_, names) in _FIELDS.items() if plain in names), None)


def parse_camera(entries: Entries, what: object, rectified: bool = False) -> Camera:
    """Parse the camera in the entries of a calibration; `what` names the file.

    With `rectified` it is that of the rectified pictures: of the projection matrix, without distortion. Raises
    InvalidInputError, with the key, for entries that are missing or of another type, and for another lens.
    """
    keys: dict[str, str] = {}
    for key in entries:
        field = _known(key)
        if field is not None:
            keys.setdefault(field, str(key))
    content = {key: flatten_matrix(entries[key]) if field in _LISTS else entries[key] for field, key in keys.items()}
    kind = msgspec.defstruct(
        "Calibration", [(field, type_ | None, None) for field, (type_, _) in _FIELDS.items()], rename=keys, frozen=True
    )
    given: Any = convert_record(content, kind, what, strict=False)
    try:
        focal_and_center = _pinhole(given, keys, rectified)
        model = "" if rectified else _lens_model(given)
        size = (given.width, given.height) if given.resolution is None else tuple(given.resolution)
        camera = make_camera(size, focal_and_center, model, tuple(given.coefficients or ()) if not rectified else ())
        return _reduced(camera, given)
    except InvalidInputError as error:
        raise InvalidInputError(f"{what}: {error}") from error


def flatten_matrix(value: Any) -> Any:
    """The numbers of a list, of a list of lists, or of what has them as `data`."""
    value = value.get("data", value) if isinstance(value, dict) else value
    if isinstance(value, list) and value and all(isinstance(row, list) for row in value):
        return [number for row in value for number in row]
    return value


def _pinhole(given: Any, keys: dict[str, str], rectified: bool) -> tuple[float, float, float, float]:
    """fx, fy, cx, cy [pixels]. Raises InvalidInputError where they are missing, or the matrix has other numbers."""
    if given.matrix is None and given.intrinsics is not None:
        if len(given.intrinsics) != 4:
            model = given.camera_model or "pinhole"
            raise InvalidInputError(
                f"{keys['intrinsics']} of the camera model {printable(model)} has {len(given.intrinsics)} numbers; a "
                "pinhole's are fx, fy, cx and cy"
            )
        fx, fy, cx, cy = given.intrinsics
        return fx, fy, cx, cy
    field, columns = ("projection", 4) if rectified else ("matrix", 3)
    numbers, name = getattr(given, field), keys.get(field, "projection_matrix" if rectified else "camera_matrix")
    if numbers is None:
        raise InvalidInputError(
            f"{name} is missing, and so are the names of other calibrations: K of ROS's camera_info, intrinsics of "
            "Kalibr and EuRoC, fl_x of nerfstudio"
        )
    if len(numbers) != 3 * columns:
        raise InvalidInputError(f"{name} has {3 * columns} numbers, not {len(numbers)}")
    rows = [numbers[columns * row : columns * (row + 1)] for row in range(3)]
    (fx, skew, cx), (zero_x, fy, cy), (zero_y, zero_z, one) = (row[:3] for row in rows)
    if fx > 0 and (max(map(abs, (skew, zero_x, zero_y, zero_z))) > _SQUARE * fx or abs(one - 1) > _SQUARE):
        raise InvalidInputError(f"{name} is not [fx, 0, cx, 0, fy, cy, 0, 0, 1], row by row")
    return fx, fy, cx, cy


def _lens_model(given: Any) -> str:
    """The lens model of what the entries say of it; a pinhole alone tells nothing of distortion.

    Raises InvalidInputError where they disagree.
    """
    words = [given.distortion_model or "", given.camera_model or "", "fisheye" if given.fisheye else ""]
    models = [model for model in words if _plain_model(model) not in _NO_LENS]
    kinds = {_plain_model(model) in _FISHEYE for model in models}
    unknown = [model for model in models if _plain_model(model) not in _FISHEYE + _BROWN]
    if len(kinds) > 1 and not unknown:
        raise InvalidInputError(f"the lens is said to be {' and '.join(models)}: leave the one that is true")
    return (unknown or models or [""])[0]


def _plain_model(model: str) -> str:
    return model.strip().lower().replace("-", "_").replace(" ", "_")


def _reduced(camera: Camera, given: Any) -> Camera:
    """The camera of the pictures of a region and with binning: K minus the offset, divided by the binning."""
    region, whole = given.roi or Region(), (camera.width, camera.height)
    corner = int(region.x_offset), int(region.y_offset)
    size = (int(region.width), int(region.height)) if region != Region() else whole
    binning = max(1, int(given.binning_x or 1)), max(1, int(given.binning_y or 1))
    ends = zip(corner, size, whole, strict=True)
    if min(size) < 1 or any(begin + length > limit for begin, length, limit in ends):
        raise InvalidInputError(
            f"roi is {size[0]} x {size[1]} pixels from {corner[0]}, {corner[1]} on, which the {whole[0]} x {whole[1]} "
            "pixels of the camera do not hold"
        )
    width, height = (length // by for length, by in zip(size, binning, strict=True))
    if min(width, height) < 1:
        raise InvalidInputError(f"binning by {binning[0]} x {binning[1]} leaves no pixel of {size[0]} x {size[1]}")
    (x, y), (across, down) = corner, binning
    return Camera(
        width, height, camera.fx / across, camera.fy / down, (camera.cx - x) / across, (camera.cy - y) / down,
        camera.distortion, camera.fisheye,
    )  # fmt: skip


def make_camera(
    size: tuple[float | None, ...],
    numbers: tuple[float, float, float, float],
    model: str,
    coefficients: tuple[float, ...],
) -> Camera:
    """Make the camera of a width and height, fx, fy, cx, cy [pixels], a lens model and OpenCV's coefficients.

    Raises InvalidInputError, which is the same for all formats, for numbers of no camera and for another lens.
    """
    plain = _plain_model(model)
    if plain not in _FISHEYE + _BROWN + _NO_LENS:
        known = ", ".join((*_BROWN[:4], *_FISHEYE))
        raise InvalidInputError(f"the lens model {printable(model)!r} is not known here; known are {known}")
    if not all(edge is not None and abs(edge) < LARGEST and edge == int(edge) for edge in size):
        raise InvalidInputError("the picture's width and height are missing, or no whole numbers")
    fx, fy, cx, cy = numbers
    fisheye = plain in _FISHEYE
    if any(coefficients[4 if fisheye else 5 :]):
        names = "k1, k2, k3 and k4" if fisheye else "k1, k2, p1, p2 and k3"
        raise InvalidInputError(f"a lens of more than {names} is not known here: calibrate with those")
    if not all(map(math.isfinite, coefficients)):
        raise InvalidInputError(f"coefficients of distortion are finite numbers, not {coefficients}")
    kept = (*coefficients, 0.0, 0.0, 0.0, 0.0)[: max(4, min(len(coefficients), 5))]
    lens = kept[:4] if fisheye else kept if any(coefficients) else ()
    width, height = (int(edge) for edge in size if edge is not None)
    return Camera(width, height, fx, fy, cx, cy, lens, fisheye)


