"""Estimation: where the robot believes to be, from one picture at a time."""
