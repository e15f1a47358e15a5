"""Field codec: convert one kind of field to named arrays and a header of plain values, and back.

nerfnav/field/storage/checkpoint.py has the table of codecs, and puts what they make into files.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from nerfnav.field.core.info import FieldInfo
from nerfnav.field.core.protocol import Field


class StoredField(Field, Protocol):
    """A field that can be kept in a file."""

    @property
    def info(self) -> FieldInfo:
        """Where it comes from and how good it is."""
        ...

    @property
    def step(self) -> float:
        """Distance of samples along rays [m]: nothing that the field tells is finer."""
        ...


Encoded = tuple[dict[str, Any], dict[str, np.ndarray]]
"""A header of what JSON can hold, and named arrays."""


@dataclass(frozen=True)
class FieldCodec:
    """How one kind of field is kept in files."""

    name: str
    """What the header of such a file says: its format."""
    version: int
    """Of the format; raised whenever older programs could not read what is written."""
    type: type[Any]
    """Fields of this class are written by it, and of subclasses that have no codec of their own."""
    encode: Callable[[Any], Encoded]
    """Header and arrays of a field; format and version are added to the header, under these names."""
    decode: Callable[[Mapping[str, Any], Mapping[str, np.ndarray]], StoredField]
    """The field of a header and arrays, of this version or an older one, which header["version"] tells. Where they are
    not whole it raises KeyError, TypeError, ValueError or RuntimeError, which `load_field` puts into a sentence."""
