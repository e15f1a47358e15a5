"""Inertial navigation: strapdown mechanisation, preintegrated measurements, biases and gravity as part of the state."""

from nerfnav.core.renamed import attach_face

__getattr__, __dir__, __all__ = attach_face(__name__, __file__)
