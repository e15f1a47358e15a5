"""How many threads torch may use in whoever runs jobs."""

TORCH_THREADS = 1
"""Planner and filter are many small operations: more threads are no faster, and burn the cores. The large work runs
in compiled kernels, which have threads of their own."""
