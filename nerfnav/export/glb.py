"""The container of binary glTF: a header, a chunk of JSON, a chunk of data, each padded to 4 bytes."""

import json
import struct
from typing import Any

from nerfnav.errors import InvalidInputError


def packed(document: dict[str, Any], binary: bytes) -> bytes:
    """A document and its data as a file."""
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    header = struct.pack("<4sII", b"glTF", 2, 12 + 8 + len(text) + 8 + len(binary))
    return header + struct.pack("<I4s", len(text), b"JSON") + text + struct.pack("<I4s", len(binary), b"BIN\0") + binary


def parts(content: bytes) -> tuple[dict[str, Any], bytes]:
    """The document of a file and its data. Raises InvalidInputError for anything but binary glTF of version 2."""
    try:
        magic, version, _, length, kind = struct.unpack_from("<4sIII4s", content)
        if (magic, version, kind) != (b"glTF", 2, b"JSON"):
            raise ValueError("it begins otherwise")
        document = json.loads(content[20 : 20 + length])
        return document, content[28 + length :][: document["buffers"][0]["byteLength"]]
    except (ValueError, KeyError, IndexError, struct.error) as error:
        raise InvalidInputError(f"this is no binary glTF: {error}") from error
