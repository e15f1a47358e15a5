"""Output files of jobs: checked before long work, and written whole or not at all."""

import json
import math
import tempfile
from pathlib import Path
from typing import Any

from nerfnav.core.errors import NerfnavError
from nerfnav.core.files import replace_file


class OutputError(NerfnavError):
    """A place that cannot be written to."""


def prepare_folder(folder: Path) -> Path:
    """Make `folder` where it is missing, and make sure that files can be written into it."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        # asking for permissions is not enough: the superuser has them all, and read-only disks ignore them
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except OSError as error:
        raise OutputError(f"cannot write into the folder {folder}: {error.strerror}") from error


def prepare_file(path: Path) -> Path:
    """Make the folder of `path`, and make sure that the file can be written."""
    if path.is_dir():
        raise OutputError(f"cannot write the file {path}: it is a folder")
    prepare_folder(path.parent)
    return path


def write_text(path: Path, text: str) -> Path:
    """Write a whole file or none."""
    return write_bytes(path, text.encode())


def write_bytes(path: Path, content: bytes) -> Path:
    """Write a whole file or none."""
    try:
        with replace_file(path) as stream:
            stream.write(content)
    except OSError as error:
        raise OutputError(f"cannot write the file {path}: {error.strerror}") from error
    return path


def json_line(summary: dict[str, Any]) -> str:
    """One line of JSON; what is not a finite number becomes null, for JSON knows no NaN."""
    return json.dumps(_finite(summary), allow_nan=False)


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _finite(entry) for name, entry in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
