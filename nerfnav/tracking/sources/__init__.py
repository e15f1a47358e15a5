"""Sources of tracked pictures, one file for each kind."""
