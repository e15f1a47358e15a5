"""Capture prior: a photograph of a place was most likely taken as those were that the field was trained from.

A field remembers the poses of its photographs (`FieldInfo.views`: seven numbers each, position [m] and quaternion
(w, x, y, z) of T_world_camera). A search starts from there: from where the cameras stood, and halfway to their
neighbours, held as they were held, at any heading (see panorama.py).
"""

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.geometry import FORWARD_MOUNT, Pose, Similarity, so3

_MOST = 200
"""Poses that are remembered: more are alike."""
_DIGITS = 5
"""Of the numbers: 10 um, 10 urad."""
_NEIGHBOURS = 2
"""Cameras to which a camera's halfway points are taken."""
_ALIKE = 0.12
"""Attitudes nearer than this are one [rad]."""
_MOST_TILTS = 24


def encode_views(poses: Pose) -> tuple[float, ...]:
    """Encode poses T_world_camera, batch shape (n,): of evenly many of them, where there are too many."""
    poses = poses[torch.linspace(0, len(poses.position) - 1, min(_MOST, len(poses.position))).round().long()]
    numbers = torch.cat([poses.position, so3.quaternion_from_matrix(poses.rotation)], 1)
    return tuple(round(number, _DIGITS) for number in numbers.flatten().tolist())


def decode_views(numbers: tuple[float, ...]) -> Pose:
    """Decode the poses T_world_camera of `numbers`, batch shape (n,)."""
    parts = torch.tensor(numbers).reshape(-1, 7)
    return Pose(so3.matrix_from_quaternion(parts[:, 3:]), parts[:, :3])


def transform_views(numbers: tuple[float, ...], similarity: Similarity) -> tuple[float, ...]:
    """Return the numbers of the poses in a place that was aligned by a similarity."""
    return encode_views(similarity.pose(decode_views(numbers))) if numbers else ()


def list_places_near(views: Pose) -> Float[Tensor, "m 3"]:
    """Return the places of the cameras, and those halfway to the nearest others [m]."""
    at = views.position
    apart = torch.cdist(at, at) + torch.diag(torch.full((len(at),), torch.inf))
    nearest = apart.topk(min(_NEIGHBOURS, len(at) - 1), largest=False).indices
    return torch.cat([at, (0.5 * (at[:, None] + at[nearest])).reshape(-1, 3)])


def list_tilts_near(views: Pose) -> Float[Tensor, "t 3 3"]:
    """Return the attitudes of the cameras' carriers but for their heading, each once."""
    bodies = views.rotation @ FORWARD_MOUNT.rotation.T
    left = so3.from_yaw(-so3.yaw_of(bodies)) @ bodies
    tilts: list[Tensor] = []
    while len(left) and len(tilts) < _MOST_TILTS:
        alike = so3.log(left[:, None].transpose(-1, -2) @ left).norm(dim=-1) < _ALIKE
        most = int(alike.sum(1).argmax())
        tilts.append(left[most])
        left = left[~alike[most]]
    return torch.stack(tilts)
