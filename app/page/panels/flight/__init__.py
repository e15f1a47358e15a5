"""Flight panels: steering and settings, charts, the estimate, the camera, camera tracks."""
