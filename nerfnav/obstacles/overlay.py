"""Overlay: obstacles that move, drawn into pictures of what stands, and the pixels that they cover.

What stands gives a picture and its depth; obstacles are drawn where they are nearer, in their colours and without
light, as all of a ground truth. An edge covers as large a share of a pixel as of the rays that its depth has there.
"""

import cv2
import numpy as np
import torch
import trimesh
from jaxtyping import Bool, Float, UInt8
from torch import Tensor

from nerfnav.geometry import Camera, Pose
from nerfnav.obstacles.obstacle import Obstacle
from nerfnav.world import MeshRenderer

AROUND = 0.04
"""Share of a picture's width around obstacles that may show them, too: a robot is not exactly where it should be."""
_FAR = 1e6
"""Distance that stands for what nothing hides [m]."""


class Overlay:
    """Obstacles that move before the cameras of a flight."""

    def __init__(self, obstacles: tuple[Obstacle, ...]) -> None:
        """Take the shapes of obstacles, at least one."""
        self._obstacles = obstacles
        meshes = [obstacle.mesh() for obstacle in obstacles]
        self._counts = [len(mesh.vertices) for mesh in meshes]
        places = np.concatenate([obstacle.place(np.zeros(1)) for obstacle in obstacles])
        whole = trimesh.util.concatenate(meshes)
        assert isinstance(whole, trimesh.Trimesh), "all are meshes"
        self._whole, self._own = whole, np.asarray(whole.vertices) - np.repeat(places, self._counts, axis=0)

    def draw(
        self,
        image: UInt8[Tensor, "height width 3"],
        depth: Float[Tensor, "fine_height fine_width"],
        camera: Camera,
        pose: Pose,
        time: float,
    ) -> UInt8[Tensor, "height width 3"]:
        """Draw the obstacles of a time [s] into the picture of a camera at T_world_camera.

        `depth` is the distance along each ray of the picture [m], of a whole number of them along each side of a pixel.
        """
        height, width = image.shape[:2]
        rays = depth.shape[0] // height
        seen = MeshRenderer(self._at(time)).render(camera.scaled(rays), pose)
        nearer = (seen.depth < depth.to(seen.depth)).float()
        if not nearer.any():
            return image
        pixels = (height, rays, width, rays)
        color = (seen.image.float() * nearer[..., None]).reshape(*pixels, 3).mean((1, 3))
        covered = nearer.reshape(pixels).mean((1, 3))[..., None]
        return (color + (1 - covered) * image.float()).round().to(torch.uint8)

    def covered(
        self, camera: Camera, pose: Pose, time: float, around: float = AROUND
    ) -> Bool[Tensor, "height width"]:
        """Mark the pixels that obstacles cover at a time [s] where nothing is before them, and those `around` them,
        up to a share of the picture's width."""
        seen = MeshRenderer(self._at(time)).render(camera, pose).depth < _FAR
        pixels = round(around * camera.width)
        if pixels == 0 or not seen.any():
            return seen
        square = np.ones((2 * pixels + 1,) * 2, np.uint8)
        return torch.from_numpy(cv2.dilate(seen.numpy().astype(np.uint8), square)).bool()

    def _at(self, time: float) -> trimesh.Trimesh:
        places = np.concatenate([obstacle.place(np.array([time])) for obstacle in self._obstacles])
        mesh = self._whole.copy()
        mesh.vertices = self._own + np.repeat(places, self._counts, axis=0)
        return mesh
