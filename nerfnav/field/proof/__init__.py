"""Proofs of free space: depth fusion, space carving, visual hulls, and the occupancy grid they yield."""
