"""Which box the field of a capture gets where nobody says: what its photographs show.

Depth maps say it best; then silhouettes, where the photographs are cut out; then what the cameras look at, where they
all look at one thing. Cameras that pan about a room have no such thing: there, points that photographs agree on say
where the room is.
"""

import numpy as np
import torch
from jaxtyping import Float

from nerfnav.geometry import Box, PosedImages
from nerfnav.importers.captures import depths, placing
from nerfnav.importers.captures.triangulated import agreed_points

_ENOUGH = 50
"""Points below which photographs have too little in common to say where anything is."""
_MOST = 0.5
"""Share of the points that the box of the cameras must hold, or it is not what they show."""


def guessed_box(photographs: PosedImages, poses: Float[np.ndarray, "n 4 4"]) -> tuple[Box, str]:
    """The box [m], and in words what it is around; `poses` are T_world_camera."""
    if photographs.depth is not None:
        shown = depths.points_of(photographs.depth, photographs.depth_camera, poses)
        return placing.box_of_points(shown, poses), "the cameras and what the depth maps show"
    cameras = placing.box_of_cameras(poses)
    cut = None if photographs.silhouettes is None else placing.box_of_silhouettes(photographs, cameras)
    if cut is not None:
        return cut, "what the pictures do not leave clear"
    found = photographs.sightings
    points = agreed_points(photographs) if found is None else found.points.double().numpy()
    if len(points) < _ENOUGH:
        return cameras, "the cameras and what they look at"
    held = float(cameras.contains(torch.from_numpy(points).float()).float().mean())
    if held < _MOST:
        return placing.box_of_points(points, poses), "the cameras and the points that the pictures agree on"
    return cameras, f"the cameras and what they look at, which is {held:.0%} of the points that the pictures agree on"
