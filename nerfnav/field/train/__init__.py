"""Field training: voxel fields and neural fields from posed images."""
