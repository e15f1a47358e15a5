"""Live: pictures of a real camera in, the vehicle's pose and the next setpoints of its plan out."""

from nerfnav.core.renamed import attach_face

__getattr__, __dir__, __all__ = attach_face(__name__, __file__)
