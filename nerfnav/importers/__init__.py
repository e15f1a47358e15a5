"""What others have made becomes a field or a scene: captures, meshes, trained NeRFs, Gaussian splats."""
