"""Field checkpoints: save and load fields as npz files without pickle, versioned; no failure loses an older file.

A kind of field has a FieldCodec; `register` adds one from outside.
"""

import json
from pathlib import Path

import numpy as np

from nerfnav.core.errors import FieldFileError, InvalidInputError, first_line
from nerfnav.core.files import NpzArrays, open_npz, write_npz
from nerfnav.core.memory import require_memory
from nerfnav.core.registry import Registry
from nerfnav.field.core.codec import FieldCodec, StoredField
from nerfnav.field.storage.grid_codec import BRICKS, MOST_DENSE_NODES, VOXELS
from nerfnav.field.storage.neural_codec import NEURAL

_GROWTH, _GROWTH_IN_BRICKS = 5, 2.5
"""Memory while a file is read, in sizes of its arrays: a float in place of each byte, and the bytes; less
where most of it is empty."""


def save_field(field: StoredField, path: Path | str) -> int:
    """Write a field to `path` and return its size in bytes. An existing file is replaced only once all is written.

    Raises InvalidInputError for a kind of field without codec, FieldFileError where the file cannot be written.
    """
    codec = _codec_of(field)
    header, arrays = codec.encode(field)
    header = {**header, "format": codec.name, "version": codec.version}
    try:
        return write_npz(Path(path), {**arrays, "header": np.array(json.dumps(header))})
    except OSError as error:
        raise FieldFileError(f"the field cannot be written to {path}: {error.strerror}") from error


def load_field(path: Path | str) -> StoredField:
    """Read a field. Raises FieldFileError, in one sentence, for anything that is not a whole nerfnav field.

    Raises InvalidInputError where the memory cannot hold it, before it is read.
    """
    path = Path(path)
    if not path.is_file():
        raise FieldFileError(f"there is no field file {path}; make one with nerfnav train")
    try:
        with open_npz(path) as file:
            header = file.header
            codec = CODECS.get(str(header.get("format")))
            if codec is None:
                raise FieldFileError(f"{path} is not a nerfnav field; make one with nerfnav train")
            if header["version"] > codec.version:
                raise FieldFileError(f"{path} was written by a newer nerfnav; update nerfnav to read it")
            _require_room(path, file)
            return codec.decode(header, file)
    except (ValueError, LookupError, AttributeError, TypeError, RuntimeError, ArithmeticError, MemoryError) as error:
        reason = f"it has no {error}" if isinstance(error, KeyError) else first_line(error)
        raise FieldFileError(
            f"{path} is not a whole nerfnav field, but damaged, cut off or another kind of file ({reason}); "
            "make one with nerfnav train"
        ) from error
    except OSError as error:
        raise FieldFileError(f"{path} cannot be read: {error.strerror or error}") from error


def _require_room(path: Path, file: NpzArrays) -> None:
    growth = _GROWTH if file.size < 5 * MOST_DENSE_NODES else _GROWTH_IN_BRICKS
    require_memory(growth * file.size, f"the field {path.name}", "make one with larger voxels (--voxel)")


def _codec_of(field: StoredField) -> FieldCodec:
    """The codec of the field's class, or of the nearest class above it that has one."""
    of_class = {codec.type: codec for codec in CODECS.values()}
    found = next((of_class[kind] for kind in type(field).__mro__ if kind in of_class), None)
    if found is None:
        known = ", ".join(sorted(kind.__name__ for kind in of_class))
        raise InvalidInputError(
            f"a {type(field).__name__} cannot be kept in a file: bake it, or register a FieldCodec for it (known are "
            f"those of {known})"
        )
    return found


CODECS: Registry[FieldCodec] = Registry("format of fields", (VOXELS, BRICKS, NEURAL))
"""Name of a format to its codec."""


def register(codec: FieldCodec) -> None:
    """Let `save_field` and `load_field` know a kind of field. Raises NameTakenError where a format has its name."""
    CODECS.register(codec)
