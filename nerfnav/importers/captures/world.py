"""World of a capture: its cameras in metres and up."""

from dataclasses import dataclass

import numpy as np
import torch

from nerfnav.geometry import Similarity
from nerfnav.importers.captures import placing
from nerfnav.importers.captures.views import View
from nerfnav.importers.placement import Placement, rotation_to_z


@dataclass(frozen=True, eq=False)
class CameraWorld:
    """Where the cameras are, in metres and up."""

    poses: np.ndarray  # T_world_camera (n, 4, 4)
    up: np.ndarray  # in the capture's axes (3)
    scale: float  # [m] in a unit of the capture
    origin: np.ndarray  # [m], what was taken off every position (3)
    guesses: tuple[str, ...]

    @property
    def placed(self) -> Similarity:
        """What takes the capture's own coordinates here."""
        rotation = torch.from_numpy(rotation_to_z(self.up))
        return Similarity(rotation, -torch.from_numpy(self.origin).double(), self.scale)


def world_of(views: list[View], placement: Placement) -> CameraWorld:
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
    return CameraWorld(poses, up, scale or 1.0, origin, tuple(guesses))
