"""Live: pictures of a real camera in, the vehicle's pose and the next setpoints of its plan out."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
