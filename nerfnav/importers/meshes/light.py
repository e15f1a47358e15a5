"""Light on the plain parts of a mesh, so that their edges are seen."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float, UInt8

from nerfnav.importers.meshes.parts import Parts
from nerfnav.world import Paint

_LIGHT = np.array([0.37, 0.53, 0.76])
"""Where the light on plain parts comes from: along no axis, so that the walls of a room differ."""
_SHADE = 0.45
"""How much darker than full light a plain face at right angles to it is."""


def lit(parts: Parts, normals: Float[np.ndarray, "f 3"]) -> Paint:
    """The paint, with light on plain parts. It falls on both sides of a face: files often get wrong which is seen."""
    light = 1 - _SHADE * (1 - np.abs(normals @ (_LIGHT / np.linalg.norm(_LIGHT))))
    light = np.where(parts.plain, light, 1.0)[:, None, None]
    tint: UInt8[np.ndarray, "f 3 3"] = (parts.paint.tint * light).round().astype(np.uint8)
    return replace(parts.paint, tint=tint)
