"""Surfaces of fields: meshes, textures and their atlases."""
