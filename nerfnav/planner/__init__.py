"""Planning: from a start and a goal to a trajectory through low density."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
