"""COLMAP's points, text and binary: where rays of matched features met, with the tracks of images that show them."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from nerfnav.geometry import ColmapBytes, colmap_rows
from nerfnav.importers.captures.views import LARGEST, CaptureError, Tracks

_SHORTEST = 3
"""Images in which a point must have been seen: two agree by chance."""
_WRONG = 2.0
"""Mean distance of a point from its features above which it is none [pixels]."""

_Point = tuple[tuple[float, ...], float, tuple[int, ...]]
"""Position, reprojection error [pixels] and the numbers of the images that show it."""


def read_points(model: Path, names: dict[int, str]) -> Tracks | None:
    """The points of a model that are to be trusted, in its images `names` by number; None where it keeps none.

    Raises CaptureError for a file that is cut off or no list of points, InvalidInputError for one that is not text.
    """
    binary, text = model / "points3D.bin", model / "points3D.txt"
    if not binary.is_file() and not text.is_file():
        return None
    points, images, numbers = [], [], []
    for position, error, track in _binary_points(binary) if binary.is_file() else _text_points(text):
        seen_from = {names[image] for image in track if image in names}
        if len(seen_from) < _SHORTEST or not error <= _WRONG or not (np.abs(position) < LARGEST).all():
            continue
        images += sorted(seen_from)
        numbers += len(seen_from) * [len(points)]
        points.append(position)
    return Tracks(np.array(points).reshape(-1, 3), tuple(images), np.array(numbers, int)) if points else None


def _text_points(path: Path) -> Iterator[_Point]:
    for line in colmap_rows(path):
        words = line.split()
        try:
            _, *position = map(float, words[:4])
            yield tuple(position), float(words[7]), tuple(map(int, words[8::2]))
        except (ValueError, IndexError) as error:
            raise CaptureError(f"{path} has a line that describes no point: {line[:60]!r}") from error


def _binary_points(path: Path) -> Iterator[_Point]:
    data = ColmapBytes(path)
    for _ in range(data.integer("Q")):
        data.skip(8)  # the point's own number
        position = data.numbers("3d")
        data.skip(3)  # its colour
        (error,) = data.numbers("d")
        yield position, error, tuple(map(int, data.numbers(f"{2 * data.integer('Q')}i")[::2]))
