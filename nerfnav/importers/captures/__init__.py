"""Photographs that somebody took, with their poses: nerfstudio, instant-ngp, Blender and COLMAP captures."""
