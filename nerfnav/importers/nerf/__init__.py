"""Trained NeRFs: read checkpoints of nerf-pytorch as neural fields."""
