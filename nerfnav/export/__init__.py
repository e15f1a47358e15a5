"""Export of plans and flights: to files, robots and viewers."""

from nerfnav.core.renamed import attach_face

__getattr__, __dir__, __all__ = attach_face(__name__, __file__)
