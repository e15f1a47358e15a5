"""Inertial navigation: strapdown mechanisation, preintegrated measurements, biases and gravity as part of the state."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
