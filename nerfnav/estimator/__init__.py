"""Estimation: where the robot believes to be, from one picture at a time."""

from nerfnav.core.renamed import attach_face

__getattr__, __dir__, __all__ = attach_face(__name__, __file__)
