"""Compiled flatness maps and their adjoints, in float64; each is tested equal to its robot's torch map."""
