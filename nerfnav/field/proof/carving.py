"""Space carving: prove space free by photographs alone (Kutulakos and Seitz, "A theory of shape by space carving",
IJCV 2000), with the field that was learned from them telling who looks past what.

Something that stands at a node, within a voxel to each side of it, shows one colour to all cameras that look through
there. Picture k shows it within a window of pixels that is as large, so its colour c lies, in each channel, between
the smallest and the largest colour of that window, but for the picture's noise:

    max_k min_window_k - noise  <=  c  <=  min_k max_window_k + noise

Where no colour does, nothing stands there. In front of a plain wall many colours agree, and nothing is proven: that
is the point. Cameras count where the field lets nearly all of their light pass to beyond the node. Rays that show the
background's own colour and meet nothing in the field prove all of their way free, where there is such a colour. Fog
at nodes that are proven free is none: without it more cameras see further, so that carving goes round after round.
"""

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
import torch
from jaxtyping import Bool, Float, UInt8

from nerfnav.core.jit import default_threads, threads
from nerfnav.field.core.occupancy import DENSITY_SCALE, EMPTY_RAW, SOLID_DENSITY, raw_of
from nerfnav.field.kernels import carving
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.proof.fusion import SIZES, nearest_within, window
from nerfnav.geometry import PosedImages

Nodes = Bool[torch.Tensor, "nx ny nz"]

_NOISE_KERNEL = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)
"""Sees no plane and no straight edge along an axis, only noise (Immerkaer, "Fast noise variance estimation", 1996)."""
_DEVIATION_PER_MEAN = math.sqrt(math.pi / 2) / 6
"""Standard deviation of noise for a mean absolute value of 1 behind that kernel, whose norm is 6."""
_PATCH, _FLATTEST = 8, 0.1
"""Noise is told by the flattest tenth of all patches of so many pixels along each side: others have patterns."""
_CUT_OFF = 3
"""Colours so near to black or white may be cut off there, and have no noise [0 to 255]."""


@dataclass(frozen=True)
class CarvingConfig:
    """When colours contradict each other."""

    reach: float = 1.0
    """How far from a node something may stand that is looked for, to each side [voxels]."""
    least_light: float = 0.8
    """Share of its light that a ray must have left behind a node: fog that stops more may be a wall."""
    rounding: float = 2.0
    """By how much colours may differ however clean pictures are [0 to 255]."""
    deviations: float = 3.0
    """By how many standard deviations of the pictures' noise they may differ besides."""
    company: int = 17
    """Of the 26 nodes around one that is proven, so many must be: those beside and before it, where a wall is behind.
    Single pictures that the field lets look through a wall prove lone nodes."""
    least_clear: int = 2
    """Pictures that must see nothing but the background behind a node that they prove free."""
    rounds: int = 3
    """How often all pictures are looked through, at most."""
    least_gain: float = 0.01
    """Share by which a round must have more nodes proven than the one before it for another one to follow."""


def carve_free_space(
    field: VoxelField, photographs: PosedImages, config: CarvingConfig | None = None
) -> Nodes:
    """Which nodes of `field` the photographs that it was learned from prove to be free."""
    config = config or CarvingConfig()
    slack = config.rounding + config.deviations * estimate_noise(photographs)
    thin = field.values[..., 0] < raw_of(SOLID_DENSITY)
    cleared = _carved_once(field, photographs, config, slack, thin)
    proven = erode_isolated(cleared, config.company)
    for _ in range(config.rounds - 1):
        values, before = field.values.clone(), int(proven.sum())
        values[..., 0][proven] = EMPTY_RAW
        cleared |= _carved_once(replace(field, values=values), photographs, config, slack, thin & ~cleared)
        proven = erode_isolated(cleared, config.company)
        if int(proven.sum()) <= (1 + config.least_gain) * before:
            break
    return proven


def _carved_once(
    field: VoxelField, photographs: PosedImages, config: CarvingConfig, slack: float, asked: Nodes
) -> Nodes:
    """Which of the nodes that are `asked` about are free, with all that is in the field in the way of light.

    Colours may differ by `slack` [0 to 255].
    """
    camera, spacing = photographs.camera, field.spacing.numpy().astype(np.float32)
    grid = (field.box.lower.numpy().astype(np.float32), spacing, np.float32(config.reach * spacing.max()))
    lens = np.array([camera.fx, camera.fy, camera.cx, camera.cy], np.float32)
    nothing = _nothing(field, slack)
    clear, kept = np.zeros(field.shape, np.uint8), np.empty((*field.shape, 3, 4), np.uint8)
    kept[..., :2], kept[..., 2:] = 0, 255
    sums = (asked.numpy().astype(np.uint8), clear, kept)
    with threads(default_threads()):
        for index in range(len(photographs)):
            rotation = np.ascontiguousarray(photographs.poses.rotation[index].numpy(), np.float32)
            position = np.ascontiguousarray(photographs.poses.position[index].numpy(), np.float32)
            maps = (_reach(field, photographs, index, config), *_extremes(photographs.images[index].numpy()))
            carving.look_through(grid, (rotation, position, lens), maps, SIZES, nothing, sums)
    contradiction = (kept[..., 1].astype(np.int16) - kept[..., 3]).max(-1)
    return torch.from_numpy((contradiction > 2 * slack) | (clear >= config.least_clear)) & asked


def erode_isolated(nodes: Nodes, least: int) -> Nodes:
    """Those of the nodes around which at least so many of 26 are; beyond the border all is as at it."""
    padded = torch.nn.functional.pad(nodes[None, None].float(), (1,) * 6, mode="replicate")
    around = (27 * torch.nn.functional.avg_pool3d(padded, 3, 1)[0, 0]).round()
    return nodes & (around > least)  # which counts the node itself


def estimate_noise(photographs: PosedImages) -> float:
    """Standard deviation of the pictures' own noise [0 to 255], whatever they show; 0 where nothing tells it."""
    found = [_patch_noise(image.numpy()) for image in photographs.images]
    told = np.concatenate(found) if found else np.zeros(0)
    return float(np.quantile(told, _FLATTEST)) if len(told) else 0.0


def _patch_noise(image: UInt8[np.ndarray, "h w 3"]) -> Float[np.ndarray, " patches"]:
    """What the noise would be by each patch of a picture that is nowhere cut off."""
    behind = np.abs(cv2.filter2D(image.astype(np.float32), cv2.CV_32F, _NOISE_KERNEL)).mean(-1)
    cut = np.any((image < _CUT_OFF) | (image > 255 - _CUT_OFF), axis=-1)
    rows, columns = (length // _PATCH for length in behind.shape)
    patches = [
        part[: rows * _PATCH, : columns * _PATCH].reshape(rows, _PATCH, columns, _PATCH).mean((1, 3)).reshape(-1)
        for part in (behind, cut)
    ]
    return _DEVIATION_PER_MEAN * patches[0][patches[1] == 0]


def _nothing(field: VoxelField, slack: float) -> UInt8[np.ndarray, "2 3"]:
    """Smallest and largest colours that count as the background's; none do where surroundings take its place."""
    if field.outside is not None:
        return np.stack([np.full(3, 255), np.zeros(3)]).astype(np.uint8)
    color = 255 * field.background.cpu().numpy()
    return np.clip(np.stack([np.ceil(color - slack), np.floor(color + slack)]), 0, 255).astype(np.uint8)


def _reach(
    field: VoxelField, photographs: PosedImages, index: int, config: CarvingConfig
) -> Float[np.ndarray, "levels h w"]:
    """How far light gets along the rays of one picture [m], the least of all within each window."""
    camera = photographs.camera
    origins, directions = camera.rays(photographs.poses[index])
    distances = carving.reaches(
        *field.kernel_grid, *(np.ascontiguousarray(rays.numpy(), np.float32) for rays in (origins, directions)),
        np.float32(DENSITY_SCALE), np.float32(field.step), np.float32(config.least_light),
    )  # fmt: skip
    return nearest_within(distances.reshape(camera.height, camera.width))


def _extremes(
    image: UInt8[np.ndarray, "h w 3"],
) -> tuple[UInt8[np.ndarray, "levels h w 3"], UInt8[np.ndarray, "levels h w 3"]]:
    """The smallest and the largest colours in the windows of all `SIZES` that begin at each pixel."""
    least, most = np.empty((2, len(SIZES), *image.shape), np.uint8)
    dark, bright, done = image, image, 1
    for level, size in enumerate(SIZES.tolist()):  # each from the one before it
        square = window(size - done + 1)
        dark, bright = cv2.erode(dark, square, anchor=(0, 0)), cv2.dilate(bright, square, anchor=(0, 0))
        least[level], most[level], done = dark, bright, size
    return least, most
