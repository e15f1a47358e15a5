"""Robots: how flat outputs become motion, how actions move the state, and what the body is made of."""
