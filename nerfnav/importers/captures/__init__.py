"""Captures: photographs with camera poses from nerfstudio, instant-ngp, Blender, COLMAP and phone apps."""
