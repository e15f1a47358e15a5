"""Capture importer: read views and photographs, check that they suffice, and assemble them in the world.

The photographs are resampled to one camera, with depths, sightings and a box of the field, and divided into those to
learn from and those to judge by.
"""


import os
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import torch
from jaxtyping import Float

from nerfnav.geometry import Box, Pose, PosedImages, Sightings
from nerfnav.importers.captures import depths, pictures
from nerfnav.importers.captures.config import CaptureReport, ImportConfig, ImportedCapture, ImportStep
from nerfnav.importers.captures.formats import read_views
from nerfnav.importers.captures.pictures import Picture
from nerfnav.importers.captures.placement import CameraWorld, guessed_box, place_cameras
from nerfnav.importers.captures.views import CaptureError, Tracks, View, Views
from nerfnav.importers.core.placement import Placement

LEAST_IMAGES = 4
"""Photographs below which nothing can be told about depth."""
_MOST_MISSING = 0.5
"""Share of the named photographs that may be missing."""
_NO_PARALLAX = 1e-9
"""Spread of the cameras, relative to how far from the origin they are, under which they stand in one place."""


def require_enough(found: Views, views: list[View]) -> None:
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


def require_inside(found: Views, folder: Path) -> None:
    files = (path for view in found.views for path in (view.path, *(() if view.depth is None else view.depth.files)))
    outside = next((path for path in files if not path.resolve().is_relative_to(folder.resolve())), None)
    if outside is not None:
        told = Path(os.path.relpath(outside, folder)).as_posix()
        raise CaptureError(f"the capture names a photograph outside of its own folder: {told}")


def require_parallax(poses: np.ndarray) -> None:
    centers = poses[:, :3, 3]
    if np.ptp(centers, axis=0).max() <= _NO_PARALLAX * max(1e-3, np.abs(centers).max()):
        raise CaptureError("all photographs were taken from one place: without parallax there is no depth to learn")


_MOST_HELD_OUT = 40
"""Photographs that judge a field: more take time and tell nothing new."""


def photographs_of(shots: list[Picture], poses: np.ndarray) -> PosedImages:
    """All pictures through one camera, with their silhouettes if they are cut out; empties `shots`, for memory."""
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
    silhouettes = None if opaque is None else torch.from_numpy(opaque)
    return PosedImages(torch.from_numpy(images), camera, pose, silhouettes=silhouettes)


def parted(photographs: PosedImages, test: list[bool], every: int) -> tuple[PosedImages, PosedImages]:
    """Photographs to learn from and to judge by: as the capture itself says, else every so many."""
    count = len(photographs)
    step = min(every, count)
    kept = [index for index in range(count) if test[index]] or list(range(step // 2, count, step))
    learned = sorted(set(range(count)) - set(kept))
    if len(learned) < LEAST_IMAGES - 1:
        raise CaptureError(f"only {len(learned)} photographs are left to learn from when {len(kept)} are held out")
    judged = kept[:: -(-len(kept) // _MOST_HELD_OUT)]
    return photographs.subset(learned), photographs.subset(judged)


LONGEST = 640
"""Pixels along the longest side of a photograph that nobody asked to make smaller."""


def assembled(
    found: Views,
    read: tuple[list[View], list[pictures.Picture], list[np.ndarray | None]],
    config: ImportConfig,
    downscale: int,
) -> ImportedCapture:
    views, shots, maps = read
    world = place_cameras(views, config.placement)
    known, camera = _depths(views, shots, maps, world), _camera(shots[0])
    photographs = photographs_of(shots, world.poses)
    if known is not None:
        photographs = replace(photographs, depth=known, depth_noise=depths.NOISE)
    if found.tracks is not None:
        photographs = replace(photographs, sightings=_sightings(found.tracks, views, world))
    box, guesses = _box(photographs, world, config.placement)
    if config.downscale is None and downscale > 1:
        guesses += (f"downscale: photographs are made {downscale} times smaller, to {LONGEST} pixels at most",)
    learned, held_out = parted(photographs, [view.test for view in views], config.held_out_every)
    cut_out = photographs.silhouettes is not None
    background = torch.ones(3) if cut_out else learned.images.float().mean((0, 1, 2)) / 255
    report = CaptureReport(
        found.kind,
        len(found.views),
        len(views),
        len(found.views) - len(views),
        len(held_out),
        (photographs.camera.width, photographs.camera.height),
        downscale,
        sum(depth is not None for depth in maps),
        0 if found.tracks is None else len(found.tracks.points),
        world.scale,
        _rounded(world.up),
        (_rounded(box.lower.numpy()), _rounded(box.upper.numpy())),
        camera,
        world.placed.numbers,
        world.guesses + guesses,
    )
    return ImportedCapture(learned, held_out, box, background, cut_out, report)


def _camera(shot: pictures.Picture) -> tuple[float, ...]:
    """What took a picture, its lens included; nothing where the lens has more numbers than k1, k2, p1, p2 and k3."""
    if shot.camera.fisheye:
        return shot.camera.numbers
    lens = shot.distortion[:5]
    return () if any(shot.distortion[5:]) else replace(shot.camera, distortion=lens if any(lens) else ()).numbers


def _depths(
    views: list[View], shots: list[pictures.Picture], maps: list[np.ndarray | None], world: CameraWorld
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


def _sightings(tracks: Tracks, views: list[View], world: CameraWorld) -> Sightings:
    """Where the points of tracks are in the world, and which of the `views` show them."""
    index = {view.name: number for number, view in enumerate(views)}
    image = torch.tensor([index.get(name, -1) for name in tracks.names])
    points = world.placed(torch.from_numpy(tracks.points)).float()
    return Sightings(points, image[image >= 0], torch.from_numpy(tracks.numbers)[image >= 0])


def _box(photographs: PosedImages, world: CameraWorld, placement: Placement) -> tuple[Box, tuple[str, ...]]:
    """The box of the field, and what was guessed of it."""
    if placement.box is not None:
        lower, upper = (torch.from_numpy(np.array(corner) - world.origin).float() for corner in placement.box)
        return Box(lower, upper), ()
    box, why = guessed_box(photographs, world.poses)
    return box, (f"box: {box.describe()}, around {why}",)


def _rounded(point: np.ndarray) -> tuple[float, ...]:
    return tuple(round(float(number), 4) for number in point)


_MOST_BYTES = 4 << 30
"""Memory that the photographs may take."""


def import_capture(source: Path, config: ImportConfig) -> Iterator[ImportStep]:
    """Read a capture, one step for each photograph; the last step carries all of it.

    Raises CaptureError, in one sentence, for what no field can be trained from.
    """
    found = read_views(source)
    require_enough(found, [view for view in found.views if view.exists])
    if config.within is not None:
        require_inside(found, config.within)
    views: list[View] = []
    shots: list[Picture] = []
    maps: list[np.ndarray | None] = []
    downscale, held = config.downscale, 0
    for index, view in enumerate(found.views):
        pixels = pictures.read_pixels(view.path, view.lens) if view.exists else None
        if pixels is not None:
            downscale = downscale or max(1, -(-max(pixels.shape[:2]) // LONGEST))
            views.append(view)
            shots.append(_shrunk(view, pixels, downscale))
            maps.append(depths.read_depth(view) if config.depth and view.depth is not None else None)
            held += shots[-1].pixels.nbytes + (0 if maps[-1] is None else maps[-1].nbytes)
        if held > _MOST_BYTES:
            raise CaptureError(f"the photographs take more than {_MOST_BYTES >> 30} GB of memory: make them smaller")
        yield ImportStep(0.9 * (index + 1) / len(found.views))
    require_enough(found, views)
    require_parallax(np.stack([view.pose for view in views]))
    yield ImportStep(1.0, assembled(found, (views, shots, maps), config, downscale or 1))


def _shrunk(view: View, pixels: np.ndarray, downscale: int) -> Picture:
    try:
        return pictures.shrunk(pixels, view.lens, downscale)
    except CaptureError as error:
        raise CaptureError(f"{view.name}: {error}") from error
