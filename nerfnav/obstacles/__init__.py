"""Obstacles beside a field: shapes that stand or move, read from files."""

from nerfnav.core.renamed import attach_face

__getattr__, __dir__, __all__ = attach_face(__name__, __file__)
