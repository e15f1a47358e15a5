"""COLMAP's sparse models, text and binary: cameras, images and points, as its format description lays them out.

COLMAP gives T_camera_world with OpenCV axes (x right, y down, looking along z) and pixel centres at half numbers.
Points are where rays of matched features met, with the tracks of images that show them.
"""

import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from nerfnav.core.errors import InvalidInputError
from nerfnav.formats.record import printable, read_text

FILES = ("cameras", "images", "points3D")
"""Files of a model, each with the suffix .bin or .txt."""
_MODELS = {
    "SIMPLE_PINHOLE": (0, 3), "PINHOLE": (1, 4), "SIMPLE_RADIAL": (2, 4), "RADIAL": (3, 5), "OPENCV": (4, 8),
    "OPENCV_FISHEYE": (5, 8), "FULL_OPENCV": (6, 12), "SIMPLE_RADIAL_FISHEYE": (8, 4), "RADIAL_FISHEYE": (9, 5),
    "SIMPLE_FISHEYE": (14, 3), "FISHEYE": (15, 4),
}  # fmt: skip
"""Number and parameter count of each known model."""
_OTHER_MODELS = {
    "FOV": (7, 5), "THIN_PRISM_FISHEYE": (10, 12), "RAD_TAN_THIN_PRISM_FISHEYE": (11, 16), "SIMPLE_DIVISION": (12, 4),
    "DIVISION": (13, 5), "EUCM": (16, 6),
}  # fmt: skip
"""The same of models that nerfnav lacks: a camera that no image uses may have one."""
_COUNTS = {number: (name, count) for name, (number, count) in (_MODELS | _OTHER_MODELS).items()}


@dataclass(frozen=True)
class ColmapCamera:
    """A camera as COLMAP describes it; `require_known` comes before its lens."""

    number: int
    """Number by which images refer to it."""
    model: str
    """Name of its model."""
    size: tuple[float, float]
    """Width and height [pixels]."""
    numbers: tuple[float, ...]
    """The model's parameters."""
    where: str
    """The file, and its number there, as messages name it."""

    def require_known(self) -> "ColmapCamera":
        """Raise InvalidInputError for a model that is not known here, or other parameters than it has."""
        if self.model not in _MODELS:
            model, known = printable(self.model), ", ".join(_MODELS)
            raise InvalidInputError(f"{self.where} has the camera model {model}; known are: {known}")
        count = _MODELS[self.model][1]
        if len(self.numbers) != count:
            raise InvalidInputError(
                f"{self.where} has {len(self.numbers)} numbers, but the model {self.model} has {count}"
            )
        return self

    @property
    def fisheye(self) -> bool:
        """The lens follows Kannala and Brandt."""
        return "FISHEYE" in self.model

    @property
    def focal(self) -> tuple[float, float]:
        """Focal lengths along u and v [pixels]."""
        return self.numbers[0], self.numbers[0 if self._single else 1]

    @property
    def center(self) -> tuple[float, float]:
        """Principal point [pixels]; pixel corners are at whole numbers."""
        cx, cy = self.numbers[self._lens - 2 : self._lens]
        return cx, cy

    @property
    def distortion(self) -> tuple[float, ...]:
        """OpenCV's coefficients, without zeros that the model leaves out at the end."""
        return self.numbers[self._lens :]

    @property
    def _single(self) -> bool:
        return "SIMPLE" in self.model or "RADIAL" in self.model

    @property
    def _lens(self) -> int:
        """Index of the first coefficient of distortion."""
        return 3 if self._single else 4


@dataclass(frozen=True)
class ColmapImage:
    """A picture with its pose."""

    number: int
    """Number by which tracks refer to it."""
    name: str
    """File in the folder of pictures."""
    camera: int
    """Number of its camera."""
    quaternion: tuple[float, ...]
    """R_camera_world (w, x, y, z), perhaps not of length 1."""
    translation: tuple[float, ...]
    """t_camera_world, in the model's units."""


@dataclass(frozen=True)
class ColmapPoint:
    """A point that structure from motion found."""

    position: tuple[float, ...]
    """In the model's world and units."""
    error: float
    """Mean distance of its projections from its features [pixels]."""
    images: tuple[int, ...]
    """Numbers of the images that show it, one for each feature."""


@dataclass(frozen=True)
class ColmapModel:
    """A model, whose files are read when they are asked for.

    Each method raises InvalidInputError for a file that is missing, cut off, or has a line of something else.
    """

    folder: Path
    """Holds cameras, images and perhaps points3D."""

    def missing(self) -> str | None:
        """Return the first of "cameras" and "images" that the folder lacks; None where it has both."""
        return next((name for name in FILES[:2] if self._file(name) is None), None)

    def is_begun(self) -> bool:
        """Return True for a folder that holds a file of a model."""
        return any(self._file(name) is not None for name in FILES)

    def cameras(self) -> dict[int, ColmapCamera]:
        """Read the cameras by number. Those that no image uses may have any model."""
        return {camera.number: camera for camera in read_cameras(self._require("cameras"))}

    def images(self) -> list[ColmapImage]:
        """Read the images with their poses."""
        path = self._require("images")
        return list(_binary_images(path) if path.suffix == ".bin" else _text_images(path))

    def points(self) -> Iterator[ColmapPoint]:
        """Read the points; none where the folder has no such file."""
        path = self._file("points3D")
        if path is not None:
            yield from _binary_points(path) if path.suffix == ".bin" else _text_points(path)

    def _file(self, name: str) -> Path | None:
        """Return the file of that name, binary before text."""
        paths = (self.folder / f"{name}{suffix}" for suffix in (".bin", ".txt"))
        return next((path for path in paths if path.is_file()), None)

    def _require(self, name: str) -> Path:
        path = self._file(name)
        if path is None:
            lacking = "camera poses" if name == "images" else "lenses"
            raise InvalidInputError(
                f"{self.folder} is a COLMAP model without {name}.bin or {name}.txt, which holds the {lacking}: "
                "copy that file from COLMAP's output, too"
            )
        return path


def write_colmap(
    folder: Path, cameras: Sequence[ColmapCamera], images: Sequence[ColmapImage], points: Sequence[ColmapPoint]
) -> None:
    """Write a model as text, without the features of its images."""
    folder.mkdir(parents=True, exist_ok=True)
    rows: dict[str, list[Sequence[object]]] = {name: [] for name in FILES}
    for camera in cameras:
        rows["cameras"].append((camera.number, camera.model, *map(round, camera.size), *camera.numbers))
    for image in images:
        rows["images"] += [(image.number, *image.quaternion, *image.translation, image.camera, image.name), ()]
    for number, point in enumerate(points, 1):
        track = (word for image in point.images for word in (image, 0))
        rows["points3D"].append((number, *point.position, 0, 0, 0, point.error, *track))
    for name, lines in rows.items():
        (folder / f"{name}.txt").write_text("".join(" ".join(map(str, line)) + "\n" for line in lines), "utf-8")


def read_cameras(path: Path) -> Iterator[ColmapCamera]:
    """Read the cameras of cameras.txt or cameras.bin.

    Raises InvalidInputError where the file is none, is cut off, or is binary with a model of unknown length.
    """
    return _binary_cameras(path) if path.suffix == ".bin" else _text_cameras(path)


class _Bytes:
    """Reader of a binary file from its start, which raises where it ends too early."""

    def __init__(self, path: Path) -> None:
        """Read all of the file."""
        self._path, self._at = path, 0
        try:
            self._data = path.read_bytes()
        except OSError as error:
            raise InvalidInputError(f"{path} cannot be read: {error.strerror}") from error

    def numbers(self, layout: str) -> tuple[float, ...]:
        """Read the next numbers, laid out as `struct` has it."""
        return struct.unpack_from("<" + layout, self._data, self._past(struct.calcsize("<" + layout)))

    def integer(self, layout: str) -> int:
        """Read the next number, as an integer."""
        return int(self.numbers(layout)[0])

    def array(self, dtype: str, count: int) -> np.ndarray:
        """Read the next `count` numbers of a type."""
        return np.frombuffer(self._data, dtype, count, self._past(count * np.dtype(dtype).itemsize))

    def skip(self, size: int) -> None:
        """Go on behind so many bytes."""
        self._past(size)

    def text(self) -> str:
        """Read the next characters, up to a zero."""
        end = self._data.find(b"\0", self._at)
        start = self._past(len(self._data) if end < 0 else end - self._at + 1)
        return self._data[start:end].decode("utf-8", "replace")

    def _past(self, size: int) -> int:
        """Go on behind so many bytes, which the file must have, and return where they begin."""
        start, self._at = self._at, self._at + size
        if self._at > len(self._data):
            raise InvalidInputError(f"{self._path} is cut off, or no COLMAP model")
        return start


def _lines(path: Path) -> Iterator[str]:
    """Lines of a model in text without comments. Raises InvalidInputError where it is not text."""
    try:
        lines = read_text(path).replace("\r\n", "\n").replace("\r", "\n").split("\n")
    except InvalidInputError as error:
        raise InvalidInputError(f"{error}; a binary model ends in .bin") from error
    return (line.strip() for line in lines if not line.lstrip().startswith("#"))


def _text_cameras(path: Path) -> Iterator[ColmapCamera]:
    for line in filter(None, _lines(path)):
        try:
            number, model, *words = line.split()
            width, height, *values = map(float, words)
            where = f"camera {printable(number)} in {path}"
            yield ColmapCamera(int(number), model, (width, height), tuple(values), where)
        except ValueError as error:
            raise InvalidInputError(f"{path} has a line that describes no camera: {line[:60]!r}") from error


def _binary_cameras(path: Path) -> Iterator[ColmapCamera]:
    data = _Bytes(path)
    for _ in range(data.integer("Q")):
        camera, number, width, height = map(int, data.numbers("IiQQ"))
        where = f"camera {camera} in {path}"
        if number not in _COUNTS:
            raise InvalidInputError(f"{where} has the camera model {number}; known are: {', '.join(_MODELS)}")
        model, count = _COUNTS[number]
        yield ColmapCamera(camera, model, (width, height), data.numbers(f"{count}d"), where)


def _text_images(path: Path) -> Iterator[ColmapImage]:
    """Read images of two lines: number, pose, camera, name; and features, a line that may be empty or left out."""
    features_may_follow = False
    for line in _lines(path):
        if features_may_follow and (not line or _is_features(line)):
            features_may_follow = False
        elif line:
            try:
                number, *words, camera, name = line.split(maxsplit=9)
                qw, qx, qy, qz, tx, ty, tz = map(float, words)
                yield ColmapImage(int(number), name, int(camera), (qw, qx, qy, qz), (tx, ty, tz))
            except ValueError as error:
                raise InvalidInputError(f"{path} has a line that describes no image: {line[:60]!r}") from error
            features_may_follow = True


def _is_features(line: str) -> bool:
    """Return True for triples of u, v and a point's number: the name that ends an image's line is no number."""
    words = line.split()
    try:
        return len(words) % 3 == 0 and int(words[-1]) >= -1
    except ValueError:
        return False


def _binary_images(path: Path) -> Iterator[ColmapImage]:
    data = _Bytes(path)
    for _ in range(data.integer("Q")):
        number, pose, camera, name = data.integer("I"), data.numbers("7d"), data.integer("I"), data.text()
        data.skip(24 * data.integer("Q"))  # the features
        yield ColmapImage(number, name, camera, pose[:4], pose[4:])


def _text_points(path: Path) -> Iterator[ColmapPoint]:
    for line in filter(None, _lines(path)):
        words = line.split()
        try:
            _, *position = map(float, words[:4])
            yield ColmapPoint(tuple(position), float(words[7]), tuple(map(int, words[8::2])))
        except (ValueError, IndexError) as error:
            raise InvalidInputError(f"{path} has a line that describes no point: {line[:60]!r}") from error


def _binary_points(path: Path) -> Iterator[ColmapPoint]:
    data = _Bytes(path)
    for _ in range(data.integer("Q")):
        data.skip(8)  # the point's own number
        position = data.numbers("3d")
        data.skip(3)  # its colour
        error, length = data.numbers("d")[0], data.integer("Q")
        yield ColmapPoint(position, error, tuple(data.array("<u4", 2 * length)[::2].tolist()))
