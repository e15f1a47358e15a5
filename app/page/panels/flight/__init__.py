"""Flight panels: steering and settings, the estimate, the camera, camera tracks."""
