"""Whether a file is being written: the system frees the lock of a program that is killed."""

from pathlib import Path
from typing import IO, Any

try:
    import fcntl
except ImportError:  # a system without them: there a flight under way is listed as interrupted
    fcntl = None


def hold(stream: IO[Any]) -> None:
    """Mark a file as being written until it is closed."""
    if fcntl is not None:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)


def is_held(path: Path) -> bool:
    """Whether anybody is writing a file."""
    if fcntl is None or not path.is_file():
        return False
    with path.open("rb") as stream:
        try:
            fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except OSError:
            return True
    return False
