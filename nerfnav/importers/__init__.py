"""Importers: turn captures, meshes, trained NeRFs and Gaussian splats into fields and scenes."""

from nerfnav.core.renamed import attach_face

__getattr__, __dir__, __all__ = attach_face(__name__, __file__)
