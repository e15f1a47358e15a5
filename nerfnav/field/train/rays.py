"""Training rays: random pixels of posed images, and rays that end at the sparse points of structure from motion.

Pixels are drawn without ever holding all rays at once. A ray to a sparse point ends there, for a photograph shows it.
"""

from dataclasses import dataclass, replace

import numpy as np
import torch
from jaxtyping import Bool, Float
from torch import Tensor

from nerfnav.field.kernels.learn import rays_of_pixels
from nerfnav.geometry import Box, PosedImages


@dataclass(frozen=True)
class RayBatch:
    """Rays of one training step."""

    origins: np.ndarray
    """Camera centres (n, 3) [m]."""
    directions: np.ndarray
    """Unit viewing directions (n, 3)."""
    targets: np.ndarray
    """Colours of the photographs (n, 3), in [0, 1]."""
    jitter: np.ndarray
    """Offset of the samples of each ray, in steps (n), -0.5 to 0.5."""
    counted: np.ndarray | None = None
    """True for rays of pixels that count (n); None: all."""


class RaySampler:
    """Draws random pixels of all images, each with the same chance."""

    def __init__(
        self,
        photographs: PosedImages,
        generator: torch.Generator,
        mask: Bool[Tensor, "n height width"] | None = None,
    ) -> None:
        """Draw from the pixels of `photographs` that count and are in `mask`, in the order of `generator`."""
        camera = photographs.camera
        self._size = (camera.width, camera.height)
        self._focal = np.array([camera.fx, camera.fy], np.float32)
        self._center = np.array([camera.cx, camera.cy], np.float32)
        self._pixels = photographs.images.reshape(-1, 3).numpy()
        self._rotations = np.ascontiguousarray(photographs.poses.rotation.numpy(), np.float32)
        self._positions = np.ascontiguousarray(photographs.poses.position.numpy(), np.float32)
        self._generator = generator
        counted = photographs.mask
        drawn = counted if mask is None else mask if counted is None else mask & counted
        self._counted = None if counted is None else counted.reshape(-1)
        self._masked = None if drawn is None else drawn.reshape(-1).nonzero()[:, 0]
        self._gains = np.ones((len(photographs), 3), np.float32)

    @property
    def gains(self) -> Float[Tensor, "n 3"]:
        """Gain of each photograph, by channel: above 1 where it is too bright."""
        return torch.from_numpy(self._gains)

    def correct(self, gains: Float[Tensor, "n 3"]) -> None:
        """From now on, take each photograph for brighter than it should be by its gains (see
        field/train/exposure.py)."""
        self._gains = gains.numpy().astype(np.float32)

    def draw(self, count: int, patch: int = 1) -> RayBatch:
        """`count` random rays with their colours, in patches of `patch` x `patch` neighbouring pixels, or fewer rays.

        Rays of neighbours share nodes, which then are read from memory once: a step of as many rays takes a third of
        the time. A patch holds its drawn pixel at a random place, so that all pixels are drawn equally often.
        """
        width, height = self._size
        patch = min(patch, width, height)
        among = len(self._pixels) if self._masked is None else len(self._masked)
        chosen = torch.randint(among, (max(1, count // patch**2),), generator=self._generator)
        chosen = chosen if self._masked is None else self._masked[chosen]
        if patch == 1:
            return self._batch(chosen.numpy())
        before = torch.randint(patch, (2, len(chosen)), generator=self._generator)
        image, pixel = chosen // (width * height), chosen % (width * height)
        left = (pixel % width - before[0]).clamp(0, width - patch)
        top = (pixel // width - before[1]).clamp(0, height - patch)
        first, beside = image * width * height + top * width + left, torch.arange(patch)
        chosen = (first[:, None, None] + beside[:, None] * width + beside).reshape(-1)
        return self._batch((chosen if self._counted is None else chosen[self._counted[chosen]]).numpy())

    def draw_quarters(self, count: int) -> RayBatch:
        """`count` random rays of each quarter of each photograph, photograph by photograph, as they were taken."""
        width, height = self._size
        shape, (across, down) = (len(self._gains), 4, count), (max(1, width // 2), max(1, height // 2))
        u = torch.randint(across, shape, generator=self._generator)
        v = torch.randint(down, shape, generator=self._generator)
        quarter = torch.arange(4)[:, None]
        u, v = u + (quarter % 2) * (width - across), v + (quarter // 2) * (height - down)
        image = torch.arange(shape[0])[:, None, None]
        chosen = (image * width * height + v * width + u).reshape(-1)
        batch = self._batch(chosen.numpy())
        counted = None if self._counted is None else self._counted[chosen].numpy()
        return replace(batch, targets=batch.targets * np.repeat(self._gains, 4 * count, axis=0), counted=counted)

    def draw_view(self, image: int, longest: int) -> tuple[RayBatch, tuple[int, int]]:
        """Rays of a whole photograph, at most so many along each side, row by row; their rows and columns.

        Nothing is drawn at random: what comes later does not depend on it.
        """
        width, height = self._size
        factor = -(-max(width, height) // longest)
        rows, columns = (np.arange(factor // 2, size, factor) for size in (height, width))
        chosen = (image * width * height + rows[:, None] * width + columns).reshape(-1)
        return self._batch(chosen, np.zeros(len(chosen), np.float32)), (len(rows), len(columns))

    def _batch(self, chosen: np.ndarray, jitter: np.ndarray | None = None) -> RayBatch:
        if jitter is None:
            jitter = torch.rand(len(chosen), generator=self._generator).numpy() - np.float32(0.5)
        origins, directions = rays_of_pixels(
            chosen, *self._size, self._focal, self._center, self._rotations, self._positions
        )
        gains = self._gains[chosen // (self._size[0] * self._size[1])]
        return RayBatch(origins, directions, self._pixels[chosen] / (np.float32(255) * gains), jitter)


_SPARED = 32
"""Training steps in which a sighting is drawn once, at most."""


@dataclass(frozen=True)
class PointBatch:
    """Rays with known ends, of one training step."""

    origins: np.ndarray
    """Camera centres (n, 3) [m]."""
    directions: np.ndarray
    """Unit viewing directions (n, 3)."""
    distances: np.ndarray
    """Distances of the points (n) [m]."""
    jitter: np.ndarray
    """Offset of the samples of each ray, in steps (n), -0.5 to 0.5."""


class PointSampler:
    """Draws random sightings of the points in a box, each with the same chance."""

    def __init__(self, photographs: PosedImages, box: Box, generator: torch.Generator) -> None:
        """Look at the sightings of `photographs`; `generator` decides which come when."""
        assert photographs.sightings is not None, "these photographs come without points"
        self._sightings = photographs.sightings.where(box.contains(photographs.sightings.points))
        self._centers, self._generator = photographs.poses.position, generator

    def __len__(self) -> int:
        """Number of sightings of points."""
        return len(self._sightings)

    def draw(self, count: int) -> PointBatch:
        """Draw `count` random ones, or fewer where there are few: no sighting may outweigh the pixels."""
        count = min(count, -(-len(self) // _SPARED))
        chosen = torch.randint(len(self), (count,), generator=self._generator)
        origins = self._centers[self._sightings.image[chosen]]
        toward = self._sightings.points[self._sightings.point[chosen]] - origins
        distances = toward.norm(dim=-1).clamp_min(1e-9)
        jitter = torch.rand(count, generator=self._generator) - 0.5
        arrays = origins, toward / distances[:, None], distances, jitter
        return PointBatch(*(np.ascontiguousarray(array.numpy(), np.float32) for array in arrays))


def points_of(photographs: PosedImages, box: Box, generator: torch.Generator) -> PointSampler | None:
    """Make the sampler of sparse points; None without such points, or with depth maps, which say more."""
    if photographs.sightings is None or photographs.depth is not None:
        return None
    sampler = PointSampler(photographs, box, generator)
    return sampler if len(sampler) else None
