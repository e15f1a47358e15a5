"""Tracking: where a camera was while it took pictures, from the field alone."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
