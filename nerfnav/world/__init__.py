"""Ground truth: meshes that places are made of, seen by cameras and touched by bodies."""

from nerfnav.core.renamed import attach_face

__getattr__, __dir__, __all__ = attach_face(__name__, __file__)
