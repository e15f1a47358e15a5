"""Tracking: where a camera was while it took pictures, from the field alone."""

from nerfnav.core.renamed import attach_face

__getattr__, __dir__, __all__ = attach_face(__name__, __file__)
