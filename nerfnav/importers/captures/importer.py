"""Capture importer: read views and photographs, check that they suffice, and assemble them in the world.

The photographs are resampled to one camera, with depths, sightings and a box of the field, and divided into those to
learn from and those to judge by.
"""

import os
from collections.abc import Generator
from dataclasses import dataclass, field, replace
from pathlib import Path

import cv2
import numpy as np
import torch
from jaxtyping import Float

from nerfnav.geometry import Box, Pose, PosedImages, Sightings
from nerfnav.importers.captures import depths, pictures
from nerfnav.importers.captures.config import CaptureReport, ImportConfig, ImportedCapture
from nerfnav.importers.captures.formats import read_views
from nerfnav.importers.captures.masks import add_masks, read_mask, shrink_mask
from nerfnav.importers.captures.pictures import Picture
from nerfnav.importers.captures.placement import CameraWorld, guess_box, known_points, place_cameras
from nerfnav.importers.captures.views import CaptureError, Tracks, View, Views
from nerfnav.importers.core.progress import ImportStep, SparseModel

LEAST_IMAGES = 4
"""Fewest photographs that constrain depth."""
_MOST_MISSING = 0.5
"""Share of the named photographs that may be missing."""
_NO_PARALLAX = 1e-9
"""Extent of the camera positions, relative to their distance from the origin, below which there is no parallax."""


@dataclass
class Photographs:
    """Photographs that were read, entry by entry."""

    views: list[View] = field(default_factory=list)
    """Pose, lens and files of each."""
    pictures: list[Picture] = field(default_factory=list)
    """Pixels of each; released when they are resampled."""
    depths: list[np.ndarray | None] = field(default_factory=list)
    """Depth map of each along the optical axis, in the capture's units; None where there is none."""


def require_enough(found: Views, views: list[View]) -> None:
    named, used = len(found.views), len(views)
    if named - used > _MOST_MISSING * named:
        missing = next(view for view in found.views if view not in views)
        raise CaptureError(
            f"the capture names {named} photographs, but only {used} of them are there and readable: "
            f"the first that is not is {missing.name}"
        )
    if used < LEAST_IMAGES:
        raise CaptureError(
            f"a capture of {used} photograph{'s' * (used != 1)} is too small to learn depth: at least {LEAST_IMAGES} "
            "from different places are needed"
        )


def require_inside(found: Views, folder: Path) -> None:
    files = (path for view in found.views for path in view.files)
    outside = next((path for path in files if not path.resolve().is_relative_to(folder.resolve())), None)
    if outside is not None:
        name = Path(os.path.relpath(outside, folder)).as_posix()
        raise CaptureError(f"the capture names a photograph outside of its own folder: {name}")


def require_parallax(poses: np.ndarray) -> None:
    centers = poses[:, :3, 3]
    if np.ptp(centers, axis=0).max() <= _NO_PARALLAX * max(1e-3, np.abs(centers).max()):
        raise CaptureError("all photographs were taken from one place: without parallax there is no depth to learn")


_MOST_HELD_OUT = 40
"""Largest number of photographs that judge a field: more only take time."""


def resample_pictures(shots: list[Picture], poses: np.ndarray) -> PosedImages:
    """Resample all pictures to one camera, with silhouettes if they are cut out; empties `shots`, for memory."""
    camera = pictures.common_camera(shots)
    cut_out = all(shot.pixels.shape[2] == 4 and (shot.pixels[..., 3] < 128).any() for shot in shots)
    images = np.empty((len(shots), camera.height, camera.width, 3), np.uint8)
    shape = images.shape[:3]
    opaque = np.ones(shape, np.bool_) if cut_out else None
    mask = np.ones(shape, np.bool_) if any(shot.mask is not None for shot in shots) else None
    for index in range(len(images)):
        pixels = pictures.resample_picture(shots[index], camera)
        images[index] = pictures.over_white(pixels)
        counted = pictures.resample_mask(shots[index], camera)
        if mask is not None and counted is not None:
            mask[index] = counted
        if opaque is not None:
            # what is cut out may be thin: a pixel's neighbours count too
            opaque[index] = cv2.dilate(pixels[..., 3], np.ones((3, 3), np.uint8)) > 8
            opaque[index] |= False if counted is None else ~counted  # nothing is known there
        shots[index] = replace(shots[index], pixels=images[index])
    shots.clear()
    world = torch.from_numpy(poses.astype(np.float32))
    pose = Pose(world[:, :3, :3].contiguous(), world[:, :3, 3].contiguous())
    silhouettes, counted = (None if part is None else torch.from_numpy(part) for part in (opaque, mask))
    return PosedImages(torch.from_numpy(images), camera, pose, silhouettes=silhouettes, mask=counted)


def split_held_out(photographs: PosedImages, test: list[bool], every: int) -> tuple[PosedImages, PosedImages]:
    """Split photographs into training and held-out ones: by the capture's test split, else every n-th."""
    count = len(photographs)
    step = min(every, count)
    kept = [index for index in range(count) if test[index]] or list(range(step // 2, count, step))
    learned = sorted(set(range(count)) - set(kept))
    if len(learned) < LEAST_IMAGES - 1:
        raise CaptureError(f"only {len(learned)} photographs are left to learn from when {len(kept)} are held out")
    return photographs.subset(learned), photographs.subset(kept[:: -(-len(kept) // _MOST_HELD_OUT)])


LONGEST = 640
"""Default for the longest side of a photograph [pixels]."""


def assemble_capture(found: Views, read: Photographs, config: ImportConfig, downscale: int) -> ImportedCapture:
    """Resample the photographs, place them in the world, and split them; releases the pictures of `read`."""
    world = place_cameras(read.views, config.placement)
    known, camera = _ray_depths(read, world), _camera(read.pictures[0])
    photographs = resample_pictures(read.pictures, world.poses)
    if known is not None:
        photographs = replace(photographs, depth=known, depth_noise=depths.NOISE)
    if photographs.mask is not None and not photographs.mask.any():
        raise CaptureError("the masks leave out every pixel of all photographs: are they inverted?")
    if found.tracks is not None:
        sightings = _unmasked(_sightings(found.tracks, read.views, world), photographs)
        photographs = replace(photographs, sightings=sightings)
    if config.placement.box is None:
        guessed = guess_box(photographs, world.poses)
        box, points, guesses = guessed.box, guessed.points, (f"box: {guessed.box.describe()}, around {guessed.around}",)
    else:
        box = Box.of(*(np.array(corner) - world.origin for corner in config.placement.box))
        points, guesses = known_points(photographs, world.poses), ()
    if config.downscale is None and downscale > 1:
        guesses += (f"downscale: photographs are made {downscale} times smaller, to {LONGEST} pixels at most",)
    learned, held_out = split_held_out(photographs, [view.test for view in read.views], config.held_out_every)
    cut_out = photographs.silhouettes is not None
    background = torch.ones(3) if cut_out else _mean_color(learned)
    report = CaptureReport(
        kind=found.kind,
        images_named=len(found.views),
        images_used=len(read.views),
        images_skipped=len(found.views) - len(read.views),
        images_held_out=len(held_out),
        image_size=(photographs.camera.width, photographs.camera.height),
        downscale=downscale,
        images_with_depth=sum(depth is not None for depth in read.depths),
        images_with_mask=sum(view.mask is not None for view in read.views),
        points=0 if found.tracks is None else len(found.tracks.points),
        scale=world.scale,
        up=_rounded(world.up),
        box=(_rounded(box.lower.numpy()), _rounded(box.upper.numpy())),
        camera=camera,
        placed=world.placed.numbers,
        guesses=found.guesses + world.guesses + guesses,
        input_keys=found.keys,
    )
    return ImportedCapture(learned, held_out, box, background, cut_out, report, SparseModel(world.poses, points, box))


def _camera(shot: pictures.Picture) -> tuple[float, ...]:
    """Numbers of a picture's camera with its lens; empty where the lens has more coefficients than k1, k2, p1, p2
    and k3."""
    if shot.camera.fisheye:
        return shot.camera.numbers
    lens = shot.distortion[:5]
    return () if any(shot.distortion[5:]) else replace(shot.camera, distortion=lens if any(lens) else ()).numbers


def _ray_depths(read: Photographs, world: CameraWorld) -> Float[torch.Tensor, "n h w"] | None:
    """Depths along the rays of the camera that all pictures will have [m]; None where there are none."""
    if all(depth is None for depth in read.depths):
        return None
    camera = pictures.common_camera(read.pictures)
    rays = [
        None if depth is None else world.scale * depths.convert_to_ray_depths(depth, picture, camera, view)
        for depth, picture, view in zip(read.depths, read.pictures, read.views, strict=True)
    ]
    known = depths.stack_depths(rays)
    depths.require_units(known, world.poses[:, :3, 3])
    return known


def _sightings(tracks: Tracks, views: list[View], world: CameraWorld) -> Sightings:
    """Convert tracks to points in the world and the indices of the `views` that show them."""
    index = {view.name: number for number, view in enumerate(views)}
    image = torch.tensor([index.get(name, -1) for name in tracks.names])
    points = world.placed(torch.from_numpy(tracks.points)).float()
    return Sightings(points, image[image >= 0], torch.from_numpy(tracks.numbers)[image >= 0])


def _unmasked(sightings: Sightings, photographs: PosedImages) -> Sightings:
    """The sightings at pixels that count: a mask covers what moves."""
    if photographs.mask is None:
        return sightings
    kept = torch.ones(len(sightings), dtype=torch.bool)
    for index, mask in enumerate(photographs.mask):
        of_image = (sightings.image == index).nonzero()[:, 0]
        points = sightings.points[sightings.point[of_image]]
        uv, inside = photographs.camera.project(photographs.poses[index], points)
        u, v = uv[inside].long().unbind(-1)
        kept[of_image[inside]] = mask[v, u]
    return replace(sightings, image=sightings.image[kept], point=sightings.point[kept])


def _mean_color(photographs: PosedImages) -> Float[torch.Tensor, "3"]:
    """Mean colour of the pixels that count, in [0, 1]."""
    images = photographs.images
    counted = images if photographs.mask is None else images[photographs.mask]
    return counted.float().mean(tuple(range(counted.ndim - 1))) / 255


def _rounded(point: np.ndarray) -> tuple[float, ...]:
    return tuple(round(float(number), 4) for number in point)


_MOST_BYTES = 4 << 30
"""Memory that the photographs may take."""


def import_capture(source: Path, config: ImportConfig) -> Generator[ImportStep, None, ImportedCapture]:
    """Read a capture, one step for each photograph, and return it.

    Raises CaptureError, in one sentence, for captures that no field can be trained from.
    """
    doing = "reading photographs"
    found = add_masks(read_views(source))
    require_enough(found, [view for view in found.views if view.exists])
    if config.within is not None:
        require_inside(found, config.within)
    read = Photographs()
    downscale, held = config.downscale, 0
    for index, view in enumerate(found.views):
        pixels = pictures.read_pixels(view.path, view.lens) if view.exists else None
        if pixels is not None:
            downscale = downscale or max(1, -(-max(pixels.shape[:2]) // LONGEST))
            mask = read_mask(view, pixels.shape[1], pixels.shape[0])
            try:
                picture = pictures.shrink_picture(pixels, view.lens, downscale, mask)
            except CaptureError as error:
                raise CaptureError(f"{view.name}: {error}") from error
            depth = depths.read_depth(view.depth) if config.depth and view.depth is not None else None
            if depth is not None and picture.mask is not None:
                depth[~shrink_mask(picture.mask, depth.shape[1], depth.shape[0])] = 0
            read.views.append(view)
            read.pictures.append(picture)
            read.depths.append(depth)
            held += picture.pixels.nbytes + (0 if depth is None else depth.nbytes)
        if held > _MOST_BYTES:
            raise CaptureError(f"the photographs take more than {_MOST_BYTES >> 30} GB of memory: make them smaller")
        yield ImportStep(doing, 0.9 * (index + 1) / len(found.views))
    require_enough(found, read.views)
    require_parallax(np.stack([view.pose for view in read.views]))
    capture = assemble_capture(found, read, config, downscale or 1)
    yield ImportStep(doing, 1.0, capture.model)
    return capture
