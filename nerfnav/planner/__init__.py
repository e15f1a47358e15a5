"""Planning: from a start and a goal to a trajectory through low density."""

from nerfnav.core.renamed import attach_face

__getattr__, __dir__, __all__ = attach_face(__name__, __file__)
