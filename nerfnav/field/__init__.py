"""Radiance fields: density and colour at every point of a box, how they are rendered, trained and stored."""
