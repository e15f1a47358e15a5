"""Meshes that others made become scenes: read, stood upright in metres, divided into what is solid and what is not."""
