"""Rotations, poses, cameras, boxes and grids: the geometry that everything else stands on.

World: Z-up, right-handed, metres, ENU. Body: FLU (x forward, y left, z up).
"""
