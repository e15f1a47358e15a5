"""Solvers of Eq. 2: BFGS, multi-start, Adam, warm start, shortest duration, chance constraint."""
