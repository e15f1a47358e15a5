"""Captures: photographs with camera poses from nerfstudio, instant-ngp, Blender, COLMAP, TUM RGB-D and phone apps."""
