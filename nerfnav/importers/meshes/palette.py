"""Palette: the images of a mesh, each decoded once."""

import numpy as np
from PIL.Image import Image

from nerfnav.importers.meshes.files import MeshFile
from nerfnav.importers.meshes.refusal import MeshFileError, first_sentence
from nerfnav.world.paint import Image as Pixels


class Palette:
    """Images by the object that holds them, so that parts of one texture share one array."""

    def __init__(self, file: MeshFile) -> None:
        self._file = file
        self._index: dict[int, int] = {}
        self.images: list[Pixels] = []

    def index_of(self, image: Image) -> int:
        """Where an image stands among all, each decoded once."""
        if id(image) not in self._index:
            try:
                pixels = np.asarray(image.convert("RGB"), np.uint8)
            except Exception as error:  # whatever a picture of unknown origin makes its reader raise
                raise MeshFileError(
                    f"{self._file.path} has a texture that cannot be decoded: {first_sentence(error)}"
                ) from error
            self._index[id(image)] = len(self.images)
            self.images.append(pixels)
        return self._index[id(image)]
