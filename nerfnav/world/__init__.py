"""Ground truth: meshes that places are made of, seen by cameras and touched by bodies."""
