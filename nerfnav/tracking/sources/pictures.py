"""Pictures in files, as their sensor gave them."""

from collections.abc import Iterator, Sequence
from pathlib import Path

from nerfnav.core.errors import InvalidInputError
from nerfnav.tracking.frame import Frame
from nerfnav.tracking.sources.decoded import decoded
from nerfnav.tracking.sources.in_order import after

SUFFIXES = (".png", ".jpg", ".jpeg", ".webp", ".bmp")
"""How the names of pictures end."""


def pictures_of(listed: Sequence[tuple[float, Path]], aspect: float | None) -> Iterator[Frame]:
    """Read pictures one at a time: time [s] and file of each, in order; `aspect` as `decoded` has it.

    Raises InvalidInputError where a time does not go on, or a file is missing or no picture.
    """
    last: float | None = None
    for seconds, path in listed:
        last = after(seconds, last, path.name)
        try:
            yield Frame(seconds, decoded(path.read_bytes(), aspect=aspect), path.name)
        except OSError as error:
            raise InvalidInputError(f"the picture {path} cannot be read: {error.strerror}") from error
        except InvalidInputError as error:
            raise InvalidInputError(f"{path} cannot be used: {error}") from error
