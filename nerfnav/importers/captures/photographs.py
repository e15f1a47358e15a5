"""Photographs of a capture, all through one camera."""

from dataclasses import replace

import cv2
import numpy as np
import torch

from nerfnav.geometry import Pose, PosedImages
from nerfnav.importers.captures import pictures
from nerfnav.importers.captures.pictures import Picture
from nerfnav.importers.captures.requirements import LEAST_IMAGES
from nerfnav.importers.captures.views import CaptureError

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
