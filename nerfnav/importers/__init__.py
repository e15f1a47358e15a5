"""Importers: turn captures, meshes, trained NeRFs and Gaussian splats into fields and scenes."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
