"""Ground truth: meshes that places are made of, seen by cameras and touched by bodies."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
