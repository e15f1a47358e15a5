"""Collision risk: bound of Eq. 1, tracking error, configuration-space obstacles, collision map."""
