"""Radiance fields: density and colour at every point of a box, how they are rendered, trained and stored."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
