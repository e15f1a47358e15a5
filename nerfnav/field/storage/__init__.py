"""Field files: checkpoints, and the codec of each kind of field."""
