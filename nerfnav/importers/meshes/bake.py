"""Bake a scene: make its field of its mesh alone, in seconds, to plan and fly in at once."""

from collections.abc import Generator

import numpy as np
import torch
from jaxtyping import Bool, Float

from nerfnav.field import EditStep, MeshSurface, VoxelField, bake_mesh
from nerfnav.world import CaptureConfig, RayCaster, Scene, may_stand, scene_color


def bake_scene(
    scene: Scene, voxel: float, capture: CaptureConfig | None = None
) -> Generator[EditStep, None, VoxelField]:
    """Yield progress, and return the field of a scene's box, its nodes `voxel` [m] apart.

    Free is what is connected to places where the cameras of `capture` may stand, so that the outside of closed rooms
    stays unproven. The field has no noise yet: held-out pictures tell it (nerfnav/field/train/evaluation.py).
    """
    caster, clearance = RayCaster(scene.mesh), (capture or CaptureConfig()).clearance

    def is_place(points: Float[np.ndarray, "n 3"]) -> Bool[np.ndarray, " n"]:
        return may_stand(scene, caster, torch.from_numpy(points).float(), clearance).numpy()

    surface = MeshSurface(np.asarray(scene.mesh.triangles), scene_color(scene))
    return bake_mesh(surface, scene.box, voxel, torch.tensor(scene.sky), is_place)
