"""What others have made becomes a field or a scene: captures, meshes, trained NeRFs, Gaussian splats."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
