"""Frames of ROS that do not move against each other: what /tf_static says of them."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import torch

from nerfnav.geometry import so3

Tree = dict[str, tuple[str, np.ndarray]]
"""Of each frame, its parent and T_parent_frame (4, 4)."""


def tree_of(messages: Iterable[Any]) -> Tree:
    """The tree of all tf2_msgs/TFMessage."""
    return {
        told.child_frame_id: (told.header.frame_id, _matrix(told.transform))
        for message in messages
        for told in message.transforms
    }


def between(tree: Tree, frame: str, other: str) -> np.ndarray | None:
    """T_frame_other (4, 4); None where no way leads from one to the other."""
    ways = [_from_root(tree, name) for name in (frame, other)]
    if ways[0] is None or ways[1] is None or ways[0][0] != ways[1][0]:
        return None
    return np.linalg.inv(ways[0][1]) @ ways[1][1]


def _from_root(tree: Tree, frame: str) -> tuple[str, np.ndarray] | None:
    """The root above a frame, and T_root_frame; None where frames are above themselves."""
    at = np.eye(4)
    for _ in range(len(tree) + 1):
        if frame not in tree:
            return frame, at
        frame, above = tree[frame]
        at = above @ at
    return None


def _matrix(transform: Any) -> np.ndarray:
    turn, shift = transform.rotation, transform.translation
    matrix = np.eye(4)
    quaternion = torch.tensor([turn.w, turn.x, turn.y, turn.z], dtype=torch.float64)
    matrix[:3, :3], matrix[:3, 3] = so3.matrix_from_quaternion(quaternion).numpy(), (shift.x, shift.y, shift.z)
    return matrix
