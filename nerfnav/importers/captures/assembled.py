"""From photographs that were read to a capture in the world."""

from dataclasses import replace

import numpy as np
import torch
from jaxtyping import Float

from nerfnav.geometry import Box, PosedImages, Sightings
from nerfnav.importers.captures import depths, pictures
from nerfnav.importers.captures.boxing import guessed_box
from nerfnav.importers.captures.imported import CaptureReport, ImportConfig, ImportedCapture
from nerfnav.importers.captures.photographs import parted, photographs_of
from nerfnav.importers.captures.views import Tracks, View, Views
from nerfnav.importers.captures.world import CameraWorld, world_of
from nerfnav.importers.placement import Placement

LONGEST = 640
"""Pixels along the longest side of a photograph that nobody asked to make smaller."""


def assembled(
    found: Views,
    read: tuple[list[View], list[pictures.Picture], list[np.ndarray | None]],
    config: ImportConfig,
    downscale: int,
) -> ImportedCapture:
    views, shots, maps = read
    world = world_of(views, config.placement)
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
