"""Robots: how flat outputs become motion, how actions move the state, and what the body is made of."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
