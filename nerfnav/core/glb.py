"""Binary glTF 2.0 container: a header, a chunk of JSON, a chunk of data, each padded to 4 bytes."""

import json
import struct
from typing import Any

from nerfnav.core.errors import InvalidInputError

_MAGIC, _JSON, _BINARY = b"glTF", b"JSON", b"BIN\0"


class ContainerError(InvalidInputError):
    """Error: a file is no container, or not whole; the message goes on from the name of the file."""


def packed(document: dict[str, Any], binary: bytes) -> bytes:
    """A document and its data as a file."""
    text = json.dumps(document).encode()
    text += b" " * (-len(text) % 4)
    binary += b"\0" * (-len(binary) % 4)
    chunks = struct.pack("<I4s", len(text), _JSON) + text + struct.pack("<I4s", len(binary), _BINARY) + binary
    return struct.pack("<4sII", _MAGIC, 2, 12 + len(chunks)) + chunks


def chunks(content: bytes) -> tuple[bytes, bytes]:
    """The text of the JSON and the data, empty where there is none. Raises ContainerError."""
    if content[:4] != _MAGIC:
        raise ContainerError("is not a .glb file: it does not begin with glTF")
    if len(content) < 20:
        raise ContainerError(f"is cut off: it has {len(content)} bytes")
    _, version, length, text_length, kind = struct.unpack_from("<4sIII4s", content)
    if version != 2:
        raise ContainerError(f"is binary glTF of version {version}, not 2: convert it first, with Blender for example")
    if length > len(content) or 20 + text_length > len(content):
        raise ContainerError(f"is cut off: it has {len(content)} bytes of {length}")
    if kind != _JSON:
        raise ContainerError("is damaged: its first chunk is not its header")
    start, binary = 20 + text_length, b""
    if start + 8 <= len(content):
        size, kind = struct.unpack_from("<I4s", content, start)
        binary = content[start + 8 : start + 8 + size] if kind == _BINARY else b""
    return content[20:start], binary


def parts(content: bytes) -> tuple[dict[str, Any], bytes]:
    """The document and the data of a file. Raises InvalidInputError for anything but a whole one."""
    try:
        text, binary = chunks(content)
        document = json.loads(text)
        return document, binary[: document["buffers"][0]["byteLength"]]
    except ContainerError as error:
        raise InvalidInputError(f"this is no binary glTF: it {error}") from error
    except (ValueError, KeyError, IndexError, TypeError) as error:
        raise InvalidInputError(f"this is no binary glTF: {error}") from error
