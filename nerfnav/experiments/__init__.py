"""Experiments of the paper and beyond: each runs trials, and reports numbers and figures."""
