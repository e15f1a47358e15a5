"""Import a capture: what its files say, its photographs, and where it all lies in the world."""

import os
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import torch
from jaxtyping import Float

from nerfnav.geometry.box import Box
from nerfnav.geometry.camera import Pose
from nerfnav.geometry.images import PosedImages
from nerfnav.importers.captures import depths, pictures, placing
from nerfnav.importers.captures.formats import read_views
from nerfnav.importers.captures.imported import CaptureReport, ImportConfig, ImportedCapture, ImportStep
from nerfnav.importers.captures.pictures import Picture
from nerfnav.importers.captures.views import CaptureError, View, Views
from nerfnav.importers.placement import Placement, rotation_to_z

LEAST_IMAGES = 4
"""Photographs below which nothing can be told about depth."""
_LONGEST = 640
"""Pixels along the longest side of a photograph that nobody asked to make smaller."""
_MOST_MISSING = 0.5
"""Share of the named photographs that may be missing."""
_MOST_HELD_OUT = 40
"""Photographs that judge a field: more take time and tell nothing new."""
_MOST_BYTES = 4 << 30
"""Memory that the photographs may take."""
_NO_PARALLAX = 1e-9
"""Spread of the cameras, relative to how far from the origin they are, under which they stand in one place."""


def import_capture(source: Path, config: ImportConfig) -> Iterator[ImportStep]:
    """Read a capture, one step for each photograph; the last step carries all of it.

    Raises CaptureError, in one sentence, for what no field can be trained from.
    """
    found = read_views(source)
    _require_enough(found, [view for view in found.views if view.exists])
    if config.within is not None:
        _require_inside(found, config.within)
    views: list[View] = []
    shots: list[Picture] = []
    maps: list[np.ndarray | None] = []
    downscale, held = config.downscale, 0
    for index, view in enumerate(found.views):
        pixels = pictures.read_pixels(view.path) if view.exists else None
        if pixels is not None:
            downscale = downscale or max(1, -(-max(pixels.shape[:2]) // _LONGEST))
            views.append(view)
            shots.append(_shrunk(view, pixels, downscale))
            maps.append(depths.read_depth(view) if config.depth and view.depth is not None else None)
            held += shots[-1].pixels.nbytes + (0 if maps[-1] is None else maps[-1].nbytes)
        if held > _MOST_BYTES:
            raise CaptureError(f"the photographs take more than {_MOST_BYTES >> 30} GB of memory: make them smaller")
        yield ImportStep(0.9 * (index + 1) / len(found.views))
    _require_enough(found, views)
    _require_parallax(np.stack([view.pose for view in views]))
    yield ImportStep(1.0, _placed(found, (views, shots, maps), config, downscale or 1))


def _shrunk(view: View, pixels: np.ndarray, downscale: int) -> Picture:
    try:
        return pictures.shrunk(pixels, view.lens, downscale)
    except CaptureError as error:
        raise CaptureError(f"{view.name}: {error}") from error


def _require_enough(found: Views, views: list[View]) -> None:
    named, used = len(found.views), len(views)
    if named - used > _MOST_MISSING * named:
        missing = next(view for view in found.views if view not in views)
        raise CaptureError(
            f"the capture names {named} photographs, but only {used} of them are there and readable: "
            f"the first that is not is {missing.name}"
        )
    if used < LEAST_IMAGES:
        plural = "s" * (used != 1)
        raise CaptureError(
            f"a capture of {used} photograph{plural} tells nothing about depth: at least {LEAST_IMAGES} from "
            "different places are needed"
        )


def _require_inside(found: Views, folder: Path) -> None:
    files = (path for view in found.views for path in (view.path, *(() if view.depth is None else view.depth.files)))
    outside = next((path for path in files if not path.resolve().is_relative_to(folder.resolve())), None)
    if outside is not None:
        told = Path(os.path.relpath(outside, folder)).as_posix()
        raise CaptureError(f"the capture names a photograph outside of its own folder: {told}")


def _require_parallax(poses: np.ndarray) -> None:
    centers = poses[:, :3, 3]
    if np.ptp(centers, axis=0).max() <= _NO_PARALLAX * max(1e-3, np.abs(centers).max()):
        raise CaptureError("all photographs were taken from one place: without parallax there is no depth to learn")


@dataclass(frozen=True, eq=False)
class _World:
    """Where the cameras are, in metres and up."""

    poses: np.ndarray  # T_world_camera (n, 4, 4)
    up: np.ndarray  # in the capture's axes (3)
    scale: float  # [m] in a unit of the capture
    origin: np.ndarray  # [m], what was taken off every position (3)
    guesses: tuple[str, ...]


def _placed(
    found: Views,
    read: tuple[list[View], list[Picture], list[np.ndarray | None]],
    config: ImportConfig,
    downscale: int,
) -> ImportedCapture:
    views, shots, maps = read
    world = _world(views, config.placement)
    known = _depths(views, shots, maps, world)
    photographs, silhouettes = _photographs(shots, world.poses)
    if known is not None:
        photographs = replace(photographs, depth=known, depth_noise=depths.NOISE)
    box, guesses = _box(photographs, silhouettes, world, config.placement)
    if config.downscale is None and downscale > 1:
        guesses += (f"downscale: photographs are made {downscale} times smaller, to {_LONGEST} pixels at most",)
    learned, held_out = _parted(photographs, [view.test for view in views], config.held_out_every)
    background = torch.ones(3) if silhouettes is not None else learned.images.float().mean((0, 1, 2)) / 255
    report = CaptureReport(
        found.kind,
        len(found.views),
        len(views),
        len(found.views) - len(views),
        len(held_out),
        (photographs.camera.width, photographs.camera.height),
        downscale,
        sum(depth is not None for depth in maps),
        world.scale,
        _rounded(world.up),
        (_rounded(box.lower.numpy()), _rounded(box.upper.numpy())),
        world.guesses + guesses,
    )
    return ImportedCapture(learned, held_out, box, background, silhouettes is not None, report)


def _depths(
    views: list[View], shots: list[Picture], maps: list[np.ndarray | None], world: _World
) -> Float[torch.Tensor, "n h w"] | None:
    """Depths along the rays of the camera that all pictures will have [m]; None where there are none."""
    if all(depth is None for depth in maps):
        return None
    camera = pictures.common_camera(shots)
    seen = [(shot.camera, shot.distortion) for shot in shots]
    rays = [
        None if depth is None else world.scale * depths.along_rays(depth, lens, camera, view)
        for depth, lens, view in zip(maps, seen, views, strict=True)
    ]
    known = depths.stacked(rays)
    assert known is not None, "some picture has a depth map"
    depths.require_units(known, world.poses[:, :3, 3])
    return known


def _world(views: list[View], placement: Placement) -> _World:
    guesses: list[str] = []
    if placement.up is not None:
        up = np.array(placement.up) / np.linalg.norm(placement.up)
    else:
        up, sure = placing.estimated_up(np.stack([view.pose for view in views]))
        doubt = "" if sure else ", but they do not agree: have a look"
        told = " ".join(f"{number:.3g}" for number in up)
        guesses.append(f"up: {told} in the capture's axes, from how the cameras were held{doubt}")
    scale = placement.meters_per_unit
    if scale is None:
        guesses.append("scale: one unit of the capture is 1 m")
    similarity = np.eye(4)
    similarity[:3, :3] = (scale or 1.0) * rotation_to_z(up)
    poses = np.stack([view.moved(similarity).pose for view in views])
    origin = placing.far_origin(poses)
    poses[:, :3, 3] -= origin
    if origin.any():
        guesses.append(f"origin: moved to {' '.join(f'{number:.0f}' for number in origin)} m, for it lay far away")
    return _World(poses, up, scale or 1.0, origin, tuple(guesses))


def _box(
    photographs: PosedImages, silhouettes: np.ndarray | None, world: _World, placement: Placement
) -> tuple[Box, tuple[str, ...]]:
    """The box of the field, and what was guessed of it."""
    if placement.box is not None:
        lower, upper = (torch.from_numpy(np.array(corner) - world.origin).float() for corner in placement.box)
        return Box(lower, upper), ()
    if photographs.depth is not None:
        shown = depths.points_of(photographs.depth, photographs.depth_camera, world.poses)
        around = placing.box_of_points(shown, world.poses)
        return around, (f"box: {around.describe()}, around the cameras and what the depth maps show",)
    cameras = placing.box_of_cameras(world.poses)
    cut = None if silhouettes is None else placing.box_of_silhouettes(photographs, silhouettes, cameras)
    if cut is not None:
        return cut, (f"box: {cut.describe()}, around what the pictures do not leave clear",)
    return cameras, (f"box: {cameras.describe()}, around the cameras and what they look at",)


def _photographs(shots: list[Picture], poses: np.ndarray) -> tuple[PosedImages, np.ndarray | None]:
    """All pictures through one camera, and where they are opaque if they are cut out; empties `shots`, for memory."""
    camera = pictures.common_camera(shots)
    cut_out = all(shot.pixels.shape[2] == 4 and (shot.pixels[..., 3] < 128).any() for shot in shots)
    images = np.empty((len(shots), camera.height, camera.width, 3), np.uint8)
    opaque = np.ones((len(shots), camera.height, camera.width), np.bool_) if cut_out else None
    for index in range(len(images)):
        pixels = pictures.resampled(shots[index], camera)
        images[index] = pictures.over_white(pixels)
        if opaque is not None:
            # what is cut out may be thin: a pixel's neighbours count too
            opaque[index] = cv2.dilate(pixels[..., 3], np.ones((3, 3), np.uint8)) > 8
        shots[index] = replace(shots[index], pixels=images[index])
    shots.clear()
    world = torch.from_numpy(poses.astype(np.float32))
    pose = Pose(world[:, :3, :3].contiguous(), world[:, :3, 3].contiguous())
    return PosedImages(torch.from_numpy(images), camera, pose), opaque


def _parted(photographs: PosedImages, test: list[bool], every: int) -> tuple[PosedImages, PosedImages]:
    """Photographs to learn from and to judge by: as the capture itself says, else every so many."""
    count = len(photographs)
    step = min(every, count)
    kept = [index for index in range(count) if test[index]] or list(range(step // 2, count, step))
    learned = sorted(set(range(count)) - set(kept))
    if len(learned) < LEAST_IMAGES - 1:
        raise CaptureError(f"only {len(learned)} photographs are left to learn from when {len(kept)} are held out")
    judged = kept[:: -(-len(kept) // _MOST_HELD_OUT)]
    return photographs.subset(learned), photographs.subset(judged)


def _rounded(point: np.ndarray) -> tuple[float, ...]:
    return tuple(round(float(number), 4) for number in point)
