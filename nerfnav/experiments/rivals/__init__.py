"""Rivals: other people's planners beside nerfnav's, on the same flights."""
