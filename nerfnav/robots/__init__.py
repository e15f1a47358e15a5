"""Robots: flatness maps from flat outputs to motion, dynamics, bodies, limits and noise."""

from nerfnav.core.renamed import attach_face

__getattr__, __dir__, __all__ = attach_face(__name__, __file__)
