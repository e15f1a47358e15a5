"""Navigation: the receding-horizon loop that joins planner, simulator and filter into an episode."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
