"""Ground truth in a file beside the field that was learned from it: what plans and flights there are judged on.

npz without pickle; textures are PNG inside. The field's file names it, relative to itself, and holds its SHA-256.
"""

import hashlib
import json
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from nerfnav.errors import FieldFileError
from nerfnav.files import replacing
from nerfnav.importers.meshes.truth_codec import FORMAT, VERSION, arrays_of, scene_of
from nerfnav.world import Scene


@dataclass(frozen=True)
class TruthLink:
    """How a field's file tells where its ground truth is."""

    name: str
    """Name of the file, in the same folder."""
    sha256: str
    """What it must hold, as 64 hexadecimal digits."""


def truth_path(field: Path) -> Path:
    """Where the ground truth of a field file lies: `house.truth.npz` beside `house.npz`."""
    return field.with_name(f"{field.stem}.truth.npz")


@contextmanager
def truth_beside(scene: Scene, field: Path) -> Iterator[TruthLink]:
    """Write a scene with its own paint beside the field file that is written within the block.

    It takes the place of an older one only when the block ends well: both files belong together, or neither changes.
    Raises FieldFileError where it cannot be written.
    """
    path = truth_path(field)
    try:
        with replacing(path) as stream:
            np.savez_compressed(stream, **arrays_of(scene))  # type: ignore[arg-type] # none is called allow_pickle
            stream.flush()
            yield TruthLink(path.name, _digest(Path(stream.name)))
    except OSError as error:
        raise FieldFileError(f"the ground truth cannot be written to {path}: {error.strerror}") from error


def load_truth(path: Path, sha256: str) -> Scene:
    """Read the ground truth of a field. Raises FieldFileError where it is not the one that the field names."""
    try:
        if _digest(path) != sha256:
            raise FieldFileError(
                f"{path} is not the ground truth that its field was trained from: put the right one there, or train "
                "again; without any, plans are not judged"
            )
        with np.load(path, allow_pickle=False) as file:
            header = json.loads(str(file["header"]))
            if header.get("format") != FORMAT or header["version"] > VERSION:
                raise FieldFileError(f"{path} is no ground truth that this nerfnav can read: train the field again")
            return scene_of(file, header)
    except (zipfile.BadZipFile, ValueError, KeyError, EOFError, TypeError) as error:
        raise FieldFileError(f"{path} is no whole ground truth: train the field again") from error
    except OSError as error:
        raise FieldFileError(f"the ground truth {path} cannot be read: {error.strerror}") from error


def _digest(path: Path) -> str:
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()
