"""Baselines of the paper: minimum snap and RRT, with the controller that follows their paths."""
