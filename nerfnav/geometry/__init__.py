"""Rotations, poses, cameras, boxes and grids: the geometry that everything else stands on.

World: Z-up, right-handed, metres, ENU. Body: FLU (x forward, y left, z up).
"""

from nerfnav.core.renamed import attach_face

__getattr__, __dir__, __all__ = attach_face(__name__, __file__)
