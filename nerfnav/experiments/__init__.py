"""Experiments of the paper and beyond: each runs trials, and reports numbers and figures."""

from nerfnav.core.renamed import attach_face

__getattr__, __dir__, __all__ = attach_face(__name__, __file__)
