"""Robots that navigate inside radiance fields.

A Scene is captured into images; images train a Field; a Robot turns flat outputs into motion; the planner bends
a Trajectory through the Field; the simulator moves the truth; the filter turns a picture into a Belief; the loop
joins them into an Episode. This package holds no scene names, no command line, no viewer, no prints, no threads.
"""

import os

# Idle OpenMP threads of torch and of numba spin against each other unless told to sleep (a training step beside
# a busy process: 34 ms against 2 ms); the libraries read this when they are loaded, so it stands before them.
os.environ.setdefault("OMP_WAIT_POLICY", "passive")
