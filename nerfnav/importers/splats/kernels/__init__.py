"""Compiled loops over splats."""
