"""Benchmarks: nerfnav against the paper's way, timed in one run, on one machine, with equal results."""
