"""Rotations, poses, cameras, boxes and grids: the geometry that everything else stands on.

World: Z-up, right-handed, metres, ENU. Body: FLU (x forward, y left, z up).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
