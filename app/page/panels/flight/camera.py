"""What the camera panel shows: the robot's picture beside the field's, and where they differ."""

import numpy as np

from nerfnav.estimator import FilterStep
from nerfnav_app.page.kit.theme import BELIEF, HIT

_GAP = 6  # [pixels] between two pictures
_DARK = 30  # level of grey of the gap
_AMPLIFIED = 3  # differences of a good estimate are a few levels of grey


def beside(*images: np.ndarray) -> np.ndarray:
    """Pictures (h, w, 3) side by side, as high as the highest."""
    height = max(image.shape[0] for image in images)
    columns = [
        np.pad(image, ((0, height - image.shape[0]), (0, _GAP), (0, 0)), constant_values=_DARK) for image in images
    ]
    return np.concatenate(columns, axis=1)[:, :-_GAP]


def difference(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """How much two pictures (h, w, 3) of bytes differ at each pixel, made three times as bright."""
    apart = np.abs(one.astype(np.int16) - other.astype(np.int16)).max(-1, keepdims=True)
    return np.broadcast_to(np.minimum(255, _AMPLIFIED * apart), one.shape).astype(np.uint8)


def with_pixels(image: np.ndarray, update: FilterStep | None) -> np.ndarray:
    """The picture (h, w, 3) with the pixels that the filter compared, those that it rejected as outliers in red."""
    if update is None or len(update.pixels) == 0:
        return image
    marked = image.copy()
    height, width, _ = image.shape
    columns, rows = update.pixels.numpy().astype(int).T
    inside = (rows >= 0) & (rows < height) & (columns >= 0) & (columns < width)
    believed = np.ones(len(rows), bool) if update.believed is None else update.believed.numpy()
    for chosen, color in ((believed, BELIEF), (~believed, HIT)):
        marked[rows[inside & chosen], columns[inside & chosen]] = color
    return marked
