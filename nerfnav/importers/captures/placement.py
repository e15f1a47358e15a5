"""Placement of a capture: up direction, scale, origin and box of the field.

Up: people hold cameras level, so the cameras' x axes are all but perpendicular to it. The direction u that makes the
mean of (u . x)^2 least is the smallest eigenvector of the mean of x x'; its sign is that of the mean camera top.
Where the cameras all face one direction the x axes span no plane, and the mean top is up.

Box of cameras: it holds the cameras and their focus. The focus is the point nearest to all optical axes,
argmin_p sum |(I - f f')(p - c)|^2 with centres c and directions f.

Guessed box, where none is given: from depth maps first; then from silhouettes, where the photographs are cut out; then
from the focus, where the cameras have one. Cameras that pan about a room have none: there, triangulated points give
the extent of the room.
"""

from dataclasses import dataclass

import numpy as np
import torch
from jaxtyping import Float

from nerfnav.geometry import Box, PosedImages, Similarity, count_outside_silhouettes, node_positions
from nerfnav.importers.captures import depths
from nerfnav.importers.captures.triangulation import triangulate_points
from nerfnav.importers.captures.views import View
from nerfnav.importers.core.placement import Placement, rotation_to_z

_PLANAR = 0.02
"""Second eigenvalue of the mean of x x' above which the cameras' x axes span a plane."""
_SNAP = np.cos(np.deg2rad(2.0))
"""An up so near to an axis of the capture is that axis: the capture is level already."""
_LEVEL = 0.35
"""Least upward component of the mean camera top: cameras that agree less were turned or faced straight down."""
_LYING = 0.1
"""Least upward component with cameras that face straight up or down: below it, down is assumed."""
_INWARDS = 0.3
"""Focus distance, relative to the mean distance of the cameras from their centre, above which they face inwards."""
_SUBJECT = 0.35
"""Radius of the subject, relative to its distance: about the size that fills a picture."""
_FAR = 1000.0
"""Distance of the cameras from the origin, relative to their extent, that single precision cannot hold."""
_ASTRAY = 0.005
"""Share of what is seen that may lie outside of the box on each side: depth maps have wild points."""
_AROUND = 0.02
"""Space around what is seen, in longest edges of that."""
_NODES = 40
"""Nodes along the longest edge of the box in which silhouettes are intersected."""
_HULL_MARGIN = 1.5
"""Distance between silhouettes and the box, in those nodes."""


_STRAY = 0.02
"""Share of the photographs that may show a point as clear although it is not: edges are jagged."""
_WATCHED = 0.5
"""Least number of photographs that see a point, relative to the best seen point: excludes the space next to a lens."""


@dataclass(frozen=True)
class Focus:
    """Focus of cameras: the point that they face."""

    point: np.ndarray
    """The point nearest to all optical axes (3)."""
    depth: float
    """Median distance along the optical axes; below 0 where the cameras face outwards."""
    inwards: bool
    """True where the cameras face it: it lies before them, far enough for their distances from each other."""


def estimate_up(poses: np.ndarray) -> tuple[np.ndarray, bool]:
    """The direction (3) that is up by how cameras with poses (n, 4, 4) were held, and whether they agree on it."""
    rights, top, backward = poses[:, :3, 0], poses[:, :3, 1].mean(0), poses[:, :3, 2].mean(0)
    sizes, directions = np.linalg.eigh(rights.T @ rights / len(rights))
    up = directions[:, 0] if sizes[1] > _PLANAR else top
    up = up / max(np.linalg.norm(up), 1e-12)
    points_up = top @ up if abs(top @ up) > _LYING else backward @ up
    up = up if points_up >= 0 else -up
    if np.abs(up).max() > _SNAP:
        up = np.where(np.abs(up) > 0.5, np.sign(up), 0.0)
    return up, bool(top @ up > _LEVEL)


def far_origin(poses: np.ndarray) -> np.ndarray:
    """Whole metres (3) to take off positions that lie too far from the origin, as those of maps do; else zero."""
    centers = poses[:, :3, 3]
    middle = centers.mean(0)
    extent = np.linalg.norm(centers - middle, axis=1).mean()
    return np.round(middle) if np.linalg.norm(middle) > _FAR * extent else np.zeros(3)


def focus_of(poses: np.ndarray) -> Focus:
    """Compute the focus of cameras with poses (n, 4, 4)."""
    centers, forward = poses[:, :3, 3], -poses[:, :3, 2]
    across = np.eye(3) - forward[:, :, None] * forward[:, None, :]
    # a little of every centre keeps parallel axes from leading to infinity
    weighed = across.sum(0) + 1e-3 * len(poses) * np.eye(3)
    point = np.linalg.solve(weighed, (across @ centers[..., None]).sum(0)[:, 0] + 1e-3 * centers.sum(0))
    depth = float(np.median(((point - centers) * forward).sum(1)))
    extent = float(np.linalg.norm(centers - centers.mean(0), axis=1).mean())
    return Focus(point, depth, depth > _INWARDS * extent)


def box_of_cameras(poses: np.ndarray) -> Box:
    """Box around cameras with poses (n, 4, 4) in the world and their focus."""
    centers, focus = poses[:, :3, 3], focus_of(poses)
    extent = float(np.linalg.norm(centers - centers.mean(0), axis=1).mean())
    # outwards the distance of the walls is unknown: further than the cameras went
    reach = _SUBJECT * focus.depth if focus.inwards else extent
    ahead = centers + -poses[:, :3, 2] * (focus.depth if focus.inwards else reach)
    around = [focus.point - reach, focus.point + reach] if focus.inwards else []
    points = np.concatenate([centers, ahead, np.reshape(around, (-1, 3))])
    lower, upper = points.min(0), points.max(0)
    margin = np.maximum(0.05 * (upper - lower), 0.02 * (upper - lower).max())
    return Box.of(lower - margin, upper + margin)


def box_of_points(points: Float[np.ndarray, "m 3"], poses: Float[np.ndarray, "n 4 4"]) -> Box:
    """A box around cameras with poses (n, 4, 4) and all but the outermost of the points that are seen [m]."""
    lower, upper = np.quantile(points, (_ASTRAY, 1 - _ASTRAY), axis=0)
    lower, upper = np.minimum(lower, poses[:, :3, 3].min(0)), np.maximum(upper, poses[:, :3, 3].max(0))
    margin = _AROUND * (upper - lower).max()
    return Box.of(lower - margin, upper + margin)


def box_of_silhouettes(photographs: PosedImages, box: Box) -> Box | None:
    """The box of all points in `box` that every photograph which sees them shows as opaque; None where none is.

    A coarse visual hull: first in `box`, then once more, finer, in what it left.
    """
    for _ in range(2):
        points = node_positions(box, (_NODES, _NODES, _NODES)).reshape(-1, 3)
        clear, seen = count_outside_silhouettes(photographs, points)
        inside = points[(clear <= _STRAY * seen) & (seen >= _WATCHED * seen.max())]
        if len(inside) < 2:
            return None
        margin = _HULL_MARGIN * box.size / (_NODES - 1)
        box = Box(inside.amin(0) - margin, inside.amax(0) + margin)
    return box


_ENOUGH = 50
"""Fewest points that give an extent."""
_MOST = 0.5
"""Share of the points that the box of the cameras must hold, or it is not what they show."""


@dataclass(frozen=True, eq=False)
class GuessedBox:
    """Guessed box of a field, with the points that it was guessed by."""

    box: Box
    """The box [m]."""
    around: str
    """In words, what it is around."""
    points: Float[np.ndarray, "m 3"]
    """Points that the photographs show [m]; none of cut-out pictures, whose outlines tell more."""


def known_points(photographs: PosedImages, poses: Float[np.ndarray, "n 4 4"]) -> Float[np.ndarray, "m 3"]:
    """Points [m] of the depth maps, else of structure from motion; none where the capture has neither."""
    if photographs.depth is not None:
        return depths.points_of(photographs.depth, photographs.depth_camera, poses)
    return np.zeros((0, 3)) if photographs.sightings is None else photographs.sightings.points.double().numpy()


def guess_box(photographs: PosedImages, poses: Float[np.ndarray, "n 4 4"]) -> GuessedBox:
    """Guess the box; `poses` are T_world_camera."""
    points = known_points(photographs, poses)
    if photographs.depth is not None:
        return GuessedBox(box_of_points(points, poses), "the cameras and what the depth maps show", points)
    cameras = box_of_cameras(poses)
    cut = None if photographs.silhouettes is None else box_of_silhouettes(photographs, cameras)
    if cut is not None:
        return GuessedBox(cut, "what the pictures do not leave clear", points)
    if photographs.sightings is None:
        points = triangulate_points(photographs)
    around = "the cameras and what they look at"
    if len(points) < _ENOUGH:
        return GuessedBox(cameras, around, points)
    held = float(cameras.contains(torch.from_numpy(points).float()).float().mean())
    if held < _MOST:
        box = box_of_points(points, poses)
        return GuessedBox(box, "the cameras and the points that the pictures agree on", points)
    return GuessedBox(cameras, f"{around}, which is {held:.0%} of the points that the pictures agree on", points)


@dataclass(frozen=True, eq=False)
class CameraWorld:
    """Camera poses in metres, z up."""

    poses: np.ndarray  # T_world_camera (n, 4, 4)
    up: np.ndarray  # in the capture's axes (3)
    scale: float  # [m] in a unit of the capture
    origin: np.ndarray  # [m], what was taken off every position (3)
    guesses: tuple[str, ...]

    @property
    def placed(self) -> Similarity:
        """Similarity from the capture's coordinates to the world."""
        rotation = torch.from_numpy(rotation_to_z(self.up))
        return Similarity(rotation, -torch.from_numpy(self.origin).double(), self.scale)


def place_cameras(views: list[View], placement: Placement) -> CameraWorld:
    """Place cameras in the world: turn up to z, scale to metres, and move far coordinates to the origin."""
    guesses: list[str] = []
    if placement.up is not None:
        up = np.array(placement.up) / np.linalg.norm(placement.up)
    else:
        up, sure = estimate_up(np.stack([view.pose for view in views]))
        doubt = "" if sure else ", but they do not agree: have a look"
        direction = " ".join(f"{number:.3g}" for number in up)
        guesses.append(f"up: {direction} in the capture's axes, from how the cameras were held{doubt}")
    scale = placement.meters_per_unit
    if scale is None:
        guesses.append("scale: one unit of the capture is 1 m")
    similarity = np.eye(4)
    similarity[:3, :3] = (scale or 1.0) * rotation_to_z(up)
    poses = np.stack([view.transformed(similarity).pose for view in views])
    origin = far_origin(poses)
    poses[:, :3, 3] -= origin
    if origin.any():
        guesses.append(f"origin: moved to {' '.join(f'{number:.0f}' for number in origin)} m, for it lay far away")
    return CameraWorld(poses, up, scale or 1.0, origin, tuple(guesses))
