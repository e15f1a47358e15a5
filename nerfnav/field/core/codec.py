"""Field codec: convert one kind of field to named arrays and a header of plain values, and back.

nerfnav/field/storage/checkpoint.py has the table of codecs, and puts what they make into files.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, Protocol

import numpy as np

from nerfnav.field.core.info import FieldInfo
from nerfnav.field.core.protocol import Field


class StoredField(Field, Protocol):
    """A field that can be kept in a file."""

    @property
    def info(self) -> FieldInfo:
        """Origin and quality of the field."""
        ...

    @property
    def step(self) -> float:
        """Distance of samples along rays [m]: the field holds nothing finer."""
        ...


class Encoded(NamedTuple):
    """A field as a file holds it."""

    header: dict[str, Any]
    """Values that JSON can hold."""
    arrays: dict[str, np.ndarray]
    """Arrays by their names."""


@dataclass(frozen=True)
class FieldCodec:
    """Codec of one kind of field."""

    name: str
    """Format, as the header of a file says it."""
    version: int
    """Of the format; raised whenever older programs could not read what is written."""
    type: type[Any]
    """Fields of this class are written by it, and of subclasses that have no codec of their own."""
    encode: Callable[[Any], Encoded]
    """Header and arrays of a field; format and version are added to the header, under these names."""
    decode: Callable[[Mapping[str, Any], Mapping[str, np.ndarray]], StoredField]
    """The field of a header and arrays, of this version or an older one, as header["version"] says. Where they are not
    whole it raises KeyError, TypeError, ValueError or RuntimeError, which `load_field` puts into a sentence."""
