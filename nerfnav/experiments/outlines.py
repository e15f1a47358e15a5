"""Outlines of solids, cut at a height."""


import numpy as np
import trimesh

from nerfnav.experiments.arena import Arena


def outlines(arena: Arena, height: float) -> np.ndarray:
    """Where the solids are cut at a height [m]: pieces of lines, (n, 2, 2)."""
    cuts = [trimesh.intersections.mesh_plane(solid, [0, 0, 1], [0, 0, height]) for solid in arena.scene.solids]
    return np.concatenate([np.reshape(cut, (-1, 2, 3))[..., :2] for cut in cuts])
