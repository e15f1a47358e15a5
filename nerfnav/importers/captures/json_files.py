"""JSON files of captures: one object, or one sentence about what is wrong."""

import json
from pathlib import Path
from typing import Any

from nerfnav.importers.captures.views import CaptureError


def read_json(path: Path) -> dict[str, Any]:
    """The object in a file. Raises CaptureError where there is none."""
    try:
        head = json.loads(path.read_text(encoding="utf-8"))
    except (UnicodeDecodeError, json.JSONDecodeError, RecursionError) as error:
        raise CaptureError(f"{path} is not readable as JSON: it is empty, cut off or another kind of file") from error
    except OSError as error:
        raise CaptureError(f"{path} cannot be read: {error.strerror}") from error
    if not isinstance(head, dict):
        raise CaptureError(f"{path} is JSON, but not the description of a capture")
    return head
