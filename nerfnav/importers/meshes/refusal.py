"""How a mesh file is refused."""

from nerfnav.errors import NerfnavError

_LONGEST = 160


class MeshFileError(NerfnavError):
    """A file that is no mesh that can be worked with."""


def first_sentence(error: BaseException) -> str:
    """What a reader said, short enough for one line; its kind where it said nothing."""
    lines = str(error).strip().splitlines() or [type(error).__name__]
    return lines[0][:_LONGEST]
