"""Radiance fields: density and colour at every point of a box, how they are rendered, trained and stored."""

from nerfnav.core.renamed import attach_face

__getattr__, __dir__, __all__ = attach_face(__name__, __file__)
