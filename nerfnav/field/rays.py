"""Training rays: random pixels of posed images, without ever holding all rays at once."""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.field.kernels.pixels import rays_of_pixels
from nerfnav.geometry import PosedImages


@dataclass(frozen=True)
class RayBatch:
    """What one training step looks at."""

    origins: np.ndarray
    """Camera centres (n, 3) [m]."""
    directions: np.ndarray
    """Unit viewing directions (n, 3)."""
    targets: np.ndarray
    """Colours of the photographs (n, 3), in [0, 1]."""
    jitter: np.ndarray
    """Offset of the samples of each ray, in steps (n), -0.5 to 0.5."""


class RaySampler:
    """Draws random pixels of all images, each with the same chance."""

    def __init__(self, photographs: PosedImages, generator: torch.Generator) -> None:
        """Look at `photographs`; `generator` decides which pixels come when."""
        camera = photographs.camera
        self._size = (camera.width, camera.height)
        self._focal = np.array([camera.fx, camera.fy], np.float32)
        self._center = np.array([camera.cx, camera.cy], np.float32)
        self._pixels = photographs.images.reshape(-1, 3).numpy()
        self._rotations = np.ascontiguousarray(photographs.poses.rotation.numpy(), np.float32)
        self._positions = np.ascontiguousarray(photographs.poses.position.numpy(), np.float32)
        self._generator = generator
        self._brightness = np.full(len(photographs), 1 / 255, np.float32)

    def correct(self, gains: Float[Tensor, " n"]) -> None:
        """From now on, take each photograph for brighter than it should be by its gain (see field/exposure.py)."""
        self._brightness = (1 / (255 * gains)).numpy().astype(np.float32)

    def draw(self, count: int) -> RayBatch:
        """`count` random rays with their colours."""
        chosen = torch.randint(len(self._pixels), (count,), generator=self._generator).numpy()
        jitter = torch.rand(count, generator=self._generator).numpy() - np.float32(0.5)
        origins, directions = rays_of_pixels(
            chosen, *self._size, self._focal, self._center, self._rotations, self._positions
        )
        brightness = self._brightness[chosen // (self._size[0] * self._size[1])]
        return RayBatch(origins, directions, self._pixels[chosen] * brightness[:, None], jitter)
