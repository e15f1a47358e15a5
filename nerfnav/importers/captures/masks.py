"""Masks of photographs: pixels that show something that moves, or that is no part of the place, do not count.

They come as a picture beside each photograph: named by mask_path in transforms.json; in a folder masks/ beside that of
the photographs, called NAME.png or NAME.jpg.png (nerfstudio, COLMAP): there, pixels that are 0 do not count; or as
dynamic_mask_NAME.png beside the photograph (instant-ngp): there, pixels that are not 0 do not count.
"""

import os
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from nerfnav.formats import NamedFiles
from nerfnav.importers.captures.views import ASPECT, CaptureError, MaskFile, View, Views

_FOLDERS = ("masks", "mask")
"""Names of folders of masks."""
_DYNAMIC = "dynamic_mask_{}.png"
_UP = 3
"""Folders above a photograph in which a folder of masks is looked for."""
_LOSSY = {".jpg": 127, ".jpeg": 127, ".webp": 127}
"""Level up to which a pixel counts as 0 in formats that do not keep 0; else 0."""


def add_masks(found: Views) -> Views:
    """The views with the masks that lie beside their photographs, for those whose files name none."""
    finder = _MaskFinder()
    views = (view if view.mask is not None else replace(view, mask=finder.find(view)) for view in found.views)
    return replace(found, views=tuple(views))


class _MaskFinder:
    """Finds masks beside photographs; remembers which folders of masks there are."""

    def __init__(self) -> None:
        self._folders: dict[Path, list[NamedFiles]] = {}

    def find(self, view: View) -> MaskFile | None:
        dynamic = view.path.parent / _DYNAMIC.format(view.path.stem)
        if os.path.isfile(dynamic):
            return MaskFile(dynamic, inverted=True)
        for base in view.path.parents[:_UP]:
            inside = view.path.relative_to(base)
            names = [inside, Path(*inside.parts[1:])] if len(inside.parts) > 1 else [inside]
            for masks in self._masks_in(base):
                for name in (str(name) for inside in names for name in (inside, inside.with_suffix(""))):
                    path = masks.find(name)
                    if os.path.isfile(path) and path != view.path:
                        return MaskFile(path)
        return None

    def _masks_in(self, base: Path) -> list[NamedFiles]:
        if base not in self._folders:
            self._folders[base] = [NamedFiles(base / name) for name in _FOLDERS if (base / name).is_dir()]
        return self._folders[base]


def read_mask(view: View, width: int, height: int) -> np.ndarray | None:
    """Mask of a photograph of that size [pixels] (height, width), true where a pixel counts; None without a mask.

    Raises CaptureError for a file that cannot be read, or of another shape.
    """
    if view.mask is None:
        return None
    path = view.mask.path
    try:
        # unchanged: levels are those of the file
        pixels = cv2.imread(str(path), cv2.IMREAD_UNCHANGED) if os.path.isfile(path) else None
    except cv2.error:
        pixels = None
    if pixels is None:
        raise CaptureError(f"the mask {path} of {view.name} is missing, or no whole picture")
    pixels = pixels if pixels.ndim == 3 else pixels[..., None]
    if abs(pixels.shape[1] / pixels.shape[0] * height / width - 1) > ASPECT:
        raise CaptureError(
            f"the mask {path} of {pixels.shape[1]} x {pixels.shape[0]} pixels has another shape than its picture "
            f"{view.name} of {width} x {height}"
        )
    lit = np.any(pixels[..., :3] > _LOSSY.get(path.suffix.lower(), 0), axis=-1)
    if pixels.shape[2] == 4:
        lit &= pixels[..., 3] > 0
    return shrink_mask(lit != view.mask.inverted, width, height)


def shrink_mask(mask: np.ndarray, width: int, height: int) -> np.ndarray:
    """Resize a mask (h, w): a larger pixel counts where all of those that it stands for do."""
    if mask.shape == (height, width):
        return mask
    smaller = width < mask.shape[1]
    levels = np.where(mask, np.uint8(255), np.uint8(0))
    return cv2.resize(levels, (width, height), interpolation=cv2.INTER_AREA if smaller else cv2.INTER_NEAREST) == 255
