"""Field representations: voxel grids, bricks, levels of detail, neural networks and formulas."""
