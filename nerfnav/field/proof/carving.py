"""Space carving: prove space free by photographs alone (Kutulakos and Seitz, "A theory of shape by space carving",
IJCV 2000), with visibility from the field that was learned from them.

Something that stands at a node, within a voxel to each side of it, shows one colour to all cameras that look through
there. Picture k shows it within a window of pixels that is as large, so its colour c lies, in each channel, between
the smallest and the largest colour of that window, but for the picture's noise:

    max_k min_window_k - noise  <=  c  <=  min_k max_window_k + noise

Where no colour does, nothing stands there. In front of a plain wall many colours agree, and nothing is proven: that
is the point. Cameras count where the field lets nearly all of their light pass to beyond the node. Rays that show the
background's own colour and meet nothing in the field prove all of their way free, where there is such a colour. Fog
at nodes that are proven free is none: without it more cameras see further, so that carving goes round after round.

The kernels keep, for each node and channel, the two largest of the windows' smallest colours and the two smallest of
their largest ones: where even the second ones contradict each other, no one picture that is wrong has made them do so.
"""

import math
from dataclasses import dataclass, replace

import cv2
import numpy as np
import torch
from jaxtyping import Bool, Float, UInt8

from nerfnav.core.deadline import Deadline
from nerfnav.core.jit import default_threads, kernel, prange, threads
from nerfnav.field.core.occupancy import DENSITY_SCALE, EMPTY_RAW, SOLID_DENSITY, raw_of
from nerfnav.field.kernels.cells import NEGLIGIBLE_RAW, corner_weights, interpolate, node_counts, part_of, softplus
from nerfnav.field.kernels.march import CHUNK, grid_ray, locate, next_sample, sample_count, scratch
from nerfnav.field.kernels.views import SIDE, cube_count, cube_in_view, in_camera, picture_of, position_of, window_of
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.proof.fusion import MOST, SIZES, kernel_views, nearest_within, window
from nerfnav.geometry import PosedImages

Nodes = Bool[torch.Tensor, "nx ny nz"]

_NOISE_KERNEL = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)
"""Sees no plane and no straight edge along an axis, only noise (Immerkaer, "Fast noise variance estimation", 1996)."""
_DEVIATION_PER_MEAN = math.sqrt(math.pi / 2) / 6
"""Standard deviation of noise for a mean absolute value of 1 behind that kernel, whose norm is 6."""
_PATCH, _FLATTEST = 8, 0.1
"""Noise is estimated from the flattest tenth of all patches of so many pixels along each side: others have patterns."""
_CUT_OFF = 3
"""Colours so near to black or white may be cut off there, and have no noise [0 to 255]."""


@dataclass(frozen=True)
class CarvingConfig:
    """When colours contradict each other."""

    reach: float = 1.0
    """Half width of the volume around a node that must be empty [voxels]."""
    least_light: float = 0.8
    """Share of its light that a ray must have left behind a node: fog that stops more may be a wall."""
    rounding: float = 2.0
    """Tolerance of colours for rounding [0 to 255]."""
    deviations: float = 3.0
    """Further tolerance, in standard deviations of the pictures' noise."""
    company: int = 17
    """Of the 26 nodes around one that is proven, so many must be: those beside and before it, where a wall is behind.
    Single pictures that the field lets look through a wall prove lone nodes."""
    least_clear: int = 2
    """Pictures that must see nothing but the background behind a node that they prove free."""
    rounds: int = 3
    """Largest number of rounds over all pictures."""
    least_gain: float = 0.01
    """Share by which a round must have more nodes proven than the one before it for another one to follow."""


def carve_free_space(
    field: VoxelField,
    photographs: PosedImages,
    config: CarvingConfig | None = None,
    until: Deadline | None = None,
) -> Nodes:
    """Find the nodes of `field` that the photographs it was learned from prove free.

    After the first round, another one begins only where it is expected to end before `until`.
    """
    config, until = config or CarvingConfig(), until or Deadline()
    begun_s = until.elapsed_s
    slack = config.rounding + config.deviations * estimate_noise(photographs)
    thin = field.values[..., 0] < raw_of(SOLID_DENSITY)
    cleared = _carved_once(field, photographs, config, slack, thin)
    proven = erode_isolated(cleared, config.company)
    for done in range(1, config.rounds):
        if (until.elapsed_s - begun_s) / done > until.left_s:
            break
        values, before = field.values.clone(), int(proven.sum())
        values[..., 0][proven] = EMPTY_RAW
        cleared |= _carved_once(replace(field, values=values), photographs, config, slack, thin & ~cleared)
        proven = erode_isolated(cleared, config.company)
        if int(proven.sum()) <= (1 + config.least_gain) * before:
            break
    return proven


def _carved_once(
    field: VoxelField, photographs: PosedImages, config: CarvingConfig, slack: float, candidates: Nodes
) -> Nodes:
    """Find the free ones among the `candidates`, with the light that the field stops.

    Colours may differ by `slack` [0 to 255].
    """
    spacing = field.spacing.numpy().astype(np.float32)
    grid = (field.box.lower.numpy().astype(np.float32), spacing, np.float32(config.reach * spacing.max()))
    nothing = _nothing(field, slack)
    clear, kept = np.zeros(field.shape, np.uint8), np.empty((*field.shape, 3, 4), np.uint8)
    kept[..., :2], kept[..., 2:] = 0, 255
    sums = (candidates.numpy().astype(np.uint8), clear, kept)
    with threads(default_threads()):
        for index, view in enumerate(kernel_views(photographs.poses, photographs.camera)):
            maps = (_reach(field, photographs, index, config), *_extremes(photographs.images[index].numpy()))
            look_through(grid, view, maps, SIZES, nothing, sums)
    contradiction = (kept[..., 1].astype(np.int16) - kept[..., 3]).max(-1)
    return torch.from_numpy((contradiction > 2 * slack) | (clear >= config.least_clear)) & candidates


def erode_isolated(nodes: Nodes, least: int) -> Nodes:
    """Those of the nodes around which at least so many of 26 are; beyond the border all is as at it."""
    padded = torch.nn.functional.pad(nodes[None, None].float(), (1,) * 6, mode="replicate")
    around = (27 * torch.nn.functional.avg_pool3d(padded, 3, 1)[0, 0]).round()
    return nodes & (around > least)  # which counts the node itself


def estimate_noise(photographs: PosedImages) -> float:
    """Standard deviation of the pictures' own noise [0 to 255], whatever they show; 0 where it cannot be estimated."""
    found = [_patch_noise(image.numpy()) for image in photographs.images]
    noise = np.concatenate(found) if found else np.zeros(0)
    return float(np.quantile(noise, _FLATTEST)) if len(noise) else 0.0


def _patch_noise(image: UInt8[np.ndarray, "h w 3"]) -> Float[np.ndarray, " patches"]:
    """Noise estimate of each patch of a picture that is nowhere cut off."""
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
    """Reach of light along the rays of one picture [m], the least of all within each window; 0 for what is masked."""
    camera = photographs.camera
    origins, directions = camera.rays(photographs.poses[index])
    distances = reaches(
        *field.kernel_grid, *(np.ascontiguousarray(rays.numpy(), np.float32) for rays in (origins, directions)),
        np.float32(DENSITY_SCALE), np.float32(field.step), np.float32(config.least_light),
    )  # fmt: skip
    distances = distances.reshape(camera.height, camera.width)
    if photographs.mask is not None:
        distances[~photographs.mask[index].numpy()] = 0
    return nearest_within(distances)


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


@kernel(parallel=True)
def reaches(values, occupied, lower, per_meter, origins, directions, scale, step, least_light):
    """Distance [m] (n) at which rays have less than `least_light` of their light left; infinite where they never do."""
    count, shape = origins.shape[0], node_counts(values, lower)
    distances = np.full(count, np.inf, np.float32)
    for chunk in prange((count + CHUNK - 1) // CHUNK):
        start, slope, cell, fraction, weights = scratch()
        for ray in range(chunk * CHUNK, min(count, (chunk + 1) * CHUNK)):
            enter, leave = grid_ray(origins[ray], directions[ray], lower, per_meter, shape, start, slope)
            samples = sample_count(enter, leave, step)
            light = np.float32(1.0)
            index = 0
            while index < samples:
                distance = locate(index, enter, step, start, slope, shape, cell, fraction)
                following = next_sample(index, enter, step, start, slope, cell, occupied)
                if following > index:
                    index = following
                    continue
                index += 1
                part, i, j, k = part_of(values, occupied, cell[0], cell[1], cell[2])
                corner_weights(fraction[0], fraction[1], fraction[2], weights)
                raw = interpolate(part, 0, i, j, k, weights)
                if raw < NEGLIGIBLE_RAW:
                    continue
                light *= np.float32(math.exp(-scale * softplus(raw) * step))
                if light < least_light:
                    distances[ray] = distance
                    break
    return distances


@kernel(parallel=True)
def look_through(grid, view, maps, sizes, background, sums):
    """Add to `sums` what one picture says of each node that it looks through.

    `grid` = (lower, spacing, how far windows reach from a node [m]), `view` = (rotation, position, lens), `maps` =
    (reach (levels, h, w), least, most (levels, h, w, 3)): the shortest reach of rays [m] and the smallest and largest
    colours, 0 to 255, within windows of `sizes` pixels that begin at each pixel. `background` (2, 3) are the smallest
    and largest colours that count as that of nothing.
    `sums` = (candidates, clear (nx, ny, nz): nodes to be tested, and pictures that see nothing there but the
    background; kept (nx, ny, nz, 3, 4) uint8: for each channel the largest and second largest of the smallest colours,
    the smallest and second smallest of the largest).
    """
    lower, spacing, beside = grid
    rotation, position, lens = view
    (reach, least, most), (candidates, clear, kept) = maps, sums
    shape, height, width = candidates.shape, reach.shape[1], reach.shape[2]
    for cube in prange(cube_count(shape)):
        x0, y0, z0, seen = cube_in_view(cube, lower, spacing, shape, view, width, height)
        if not seen:
            continue
        for i in range(x0, min(x0 + SIDE, shape[0])):
            for j in range(y0, min(y0 + SIDE, shape[1])):
                for k in range(z0, min(z0 + SIDE, shape[2])):
                    if not candidates[i, j, k]:
                        continue
                    x, y, z = position_of(i, j, k, lower, spacing)
                    right, down, ahead = in_camera(x, y, z, rotation, position)
                    if ahead <= np.float32(1e-9):
                        continue
                    place = picture_of(right, down, ahead, lens)
                    level, u, v = window_of(place[0], place[1], beside * lens[0] / ahead, sizes, width, height)
                    away = np.float32(math.sqrt(right * right + down * down + ahead * ahead))
                    if level < 0 or reach[level, v, u] < away:
                        continue
                    nothing = reach[level, v, u] == np.float32(np.inf)
                    for channel in range(3):
                        darkest, brightest = least[level, v, u, channel], most[level, v, u, channel]
                        nothing = nothing and darkest >= background[0, channel]
                        nothing = nothing and brightest <= background[1, channel]
                        keep(kept[i, j, k, channel], darkest, brightest)
                    if nothing:
                        clear[i, j, k] = min(clear[i, j, k] + 1, MOST)


@kernel()
def keep(kept, darkest, brightest):
    """Note a window's colours among the two most contradictory ones."""
    if darkest > kept[0]:
        kept[0], kept[1] = darkest, kept[0]
    elif darkest > kept[1]:
        kept[1] = darkest
    if brightest < kept[2]:
        kept[2], kept[3] = brightest, kept[2]
    elif brightest < kept[3]:
        kept[3] = brightest
