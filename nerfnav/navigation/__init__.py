"""Navigation: the receding-horizon loop that joins planner, simulator and filter into an episode."""

from nerfnav.core.renamed import attach_face

__getattr__, __dir__, __all__ = attach_face(__name__, __file__)
