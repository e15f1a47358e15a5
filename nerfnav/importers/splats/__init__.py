"""Gaussian splats of three file layouts, and what becomes of them: a voxel field."""
