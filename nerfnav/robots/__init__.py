"""Robots: flatness maps from flat outputs to motion, dynamics, bodies, limits and noise."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
