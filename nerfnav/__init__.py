"""Robots that navigate inside radiance fields.

A Scene is captured into images; images train a Field; a Robot turns flat outputs into motion; the planner bends
a Trajectory through the Field; the simulator moves the truth; the filter turns a picture into a Belief; the loop
joins them into an Episode. This package holds no scene names, no command line, no viewer, no prints, no threads.

What most scripts need is here by name, as in `nerfnav.plan`; a name is imported when it is first used (PEP 562), so
that `import nerfnav` takes no time. The names of a package's face, this one's and those of the packages in it, are in
the `__init__.pyi` beside it, for type checkers and for lazy_loader alike.
"""

import os

from nerfnav.core.renamed import attach_face

# Idle OpenMP threads of torch and of numba spin against each other unless set to sleep (a training step beside
# a busy process: 34 ms against 2 ms); the libraries read this when they are loaded, so it stands before them.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")

__version__ = "0.1.0"

__getattr__, __dir__, __all__ = attach_face(__name__, __file__)
