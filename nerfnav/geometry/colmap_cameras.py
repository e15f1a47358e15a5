"""COLMAP's cameras, text and binary (cameras.txt, cameras.bin), as its format description lays them out."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from nerfnav.core.errors import InvalidInputError

_MODELS = {
    "SIMPLE_PINHOLE": (0, 3), "PINHOLE": (1, 4), "SIMPLE_RADIAL": (2, 4), "RADIAL": (3, 5), "OPENCV": (4, 8),
    "OPENCV_FISHEYE": (5, 8), "FULL_OPENCV": (6, 12), "SIMPLE_RADIAL_FISHEYE": (8, 4), "RADIAL_FISHEYE": (9, 5),
}  # fmt: skip
"""Number and parameter count of each known model."""
_OTHER_MODELS = {7: "FOV", 10: "THIN_PRISM_FISHEYE"}


@dataclass(frozen=True)
class ColmapCamera:
    """A camera as COLMAP describes it."""

    number: int
    """Number by which images refer to it."""
    model: str
    """Name of its model, a known one."""
    size: tuple[float, float]
    """Width and height [pixels]."""
    numbers: tuple[float, ...]
    """The model's parameters, as many as it has."""
    where: str
    """The file, and its number there, as messages name it."""

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


class ColmapBytes:
    """Reader of a binary file from its start, which raises where it ends too early."""

    def __init__(self, path: Path) -> None:
        """Read all of the file."""
        self._path, self._data, self._at = path, path.read_bytes(), 0

    def numbers(self, layout: str) -> tuple[float, ...]:
        """The next numbers, laid out as `struct` has it."""
        size = struct.calcsize("<" + layout)
        self.skip(size)
        return struct.unpack_from("<" + layout, self._data, self._at - size)

    def integer(self, layout: str) -> int:
        """Read the next number, as an integer."""
        return int(self.numbers(layout)[0])

    def skip(self, size: int) -> None:
        """Go on behind so many bytes."""
        self._require(size)
        self._at += size

    def text(self) -> str:
        """The next characters, up to a zero."""
        end = self._data.find(b"\0", self._at)
        self._require(1 if end < 0 else end - self._at + 1, end >= 0)
        start, self._at = self._at, end + 1
        return self._data[start:end].decode("utf-8", "replace")

    def _require(self, size: int, found: bool = True) -> None:
        if not found or self._at + size > len(self._data):
            raise InvalidInputError(f"{self._path} is cut off, or no COLMAP model")


def colmap_cameras(path: Path) -> Iterator[ColmapCamera]:
    """The cameras of cameras.txt or cameras.bin.

    Raises InvalidInputError where the file is none, is cut off, or names a model that is not known here.
    """
    return _binary(path) if path.suffix == ".bin" else _text(path)


def colmap_lines(path: Path) -> list[str]:
    """The lines of a model in text. Raises InvalidInputError where it is not text."""
    try:
        return path.read_text(encoding="utf-8").splitlines()
    except UnicodeDecodeError as error:
        raise InvalidInputError(f"{path} is not text: a binary model ends in .bin") from error


def colmap_rows(path: Path) -> Iterator[str]:
    """Those of them that say something: neither empty nor a comment."""
    return (line for line in colmap_lines(path) if line.strip() and not line.lstrip().startswith("#"))


def _text(path: Path) -> Iterator[ColmapCamera]:
    for line in colmap_rows(path):
        try:
            number, model, *words = line.split()
            width, height, *values = map(float, words)
            yield _known(int(number), model, (width, height), tuple(values), path)
        except ValueError as error:
            raise InvalidInputError(f"{path} has a line that describes no camera: {line[:60]!r}") from error


def _binary(path: Path) -> Iterator[ColmapCamera]:
    data = ColmapBytes(path)
    names = {number: name for name, (number, _) in _MODELS.items()}
    for _ in range(data.integer("Q")):
        camera, number, width, height = (int(value) for value in data.numbers("iiQQ"))
        model = names.get(number, str(_OTHER_MODELS.get(number, number)))
        values = data.numbers(f"{_MODELS[model][1]}d") if model in _MODELS else ()
        yield _known(camera, model, (width, height), values, path)


def _known(number: int, model: str, size: tuple[float, float], values: tuple[float, ...], path: Path) -> ColmapCamera:
    where = f"camera {number} in {path}"
    if model not in _MODELS:
        raise InvalidInputError(f"{where} has the camera model {model}; known are: {', '.join(_MODELS)}")
    if len(values) != _MODELS[model][1]:
        raise InvalidInputError(f"{where} has {len(values)} numbers, but the model {model} has {_MODELS[model][1]}")
    return ColmapCamera(number, model, size, values, where)
