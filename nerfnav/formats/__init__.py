"""Formats of files that several packages read: each is parsed once, into typed records."""

from nerfnav.core.renamed import attach_face

__getattr__, __dir__, __all__ = attach_face(__name__, __file__)
