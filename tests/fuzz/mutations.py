"""Damage: change the bytes, the text, the values or the arrays of a file at random, by its kind.

All chance comes from the generator that is given, so that a seed repeats the damage.
"""

import gzip
import io
import json
import math
import random
import re
import struct
import zipfile
from collections.abc import Callable, Iterator
from pathlib import PurePath
from typing import Any

import numpy as np
import yaml

ODD_VALUES: tuple[Any, ...] = (
    None, True, False, 0, -1, 1, 2, 0.5, -0.0, 1e-30, 1e30, -1e300, math.inf, -math.inf, math.nan, 255, 65536, 2**31,
    2**63, 2**64, -(2**63), 10**30, "", "x", "nan", "1e999", "-1", "../x", "/", "\0", "é", "a" * 5000, [], {}, [[]],
    [None], [1, 2, 3], ["a"], [math.nan] * 3, [0] * 300, {"a": 1}, [[[[[[1]]]]]],
)  # fmt: skip
ODD_WORDS = (
    b"nan", b"inf", b"-inf", b"1e999", b"-1", b"0", b"1", b"1e30", b"-1e30", b"0.5", b"1e-30", b"99999999999",
    b"18446744073709551616", b"x", b"", b"1,5", b"0x10", b"1 2", b"9" * 5000, b"\xff", b"\0", b"-0", b"2147483648",
)  # fmt: skip
ODD_NUMBERS = tuple(
    struct.pack(code, number)
    for code, numbers in (
        ("<f", (math.nan, math.inf, -math.inf, 1e38, -1e38, 1e-40, 0.0)),
        ("<I", (0, 1, 0xFFFFFFFF, 0x7FFFFFFF, 0x80000000, 65536)),
        ("<H", (0, 0xFFFF)),
        ("<d", (math.nan, math.inf, 1e300)),
        ("<Q", (0, 2**64 - 1, 2**63, 2**40)),
    )
    for number in numbers
)
_NUMBER = re.compile(rb"[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?")
_TEXT = {".obj", ".mtl", ".dae", ".urdf", ".txt", ".csv", ".tum", ".xml", ".json", ".yaml", ".yml", ".gltf", ".jsonl"}
_HEADER_BYTES = 1500


def damage(name: str, data: bytes, chance: random.Random) -> bytes:
    """Damage the content of a file of that name once, in a way that its kind allows."""
    suffix = PurePath(name).suffix.lower()
    ways: list[Callable[[bytes, random.Random], bytes]] = [damage_bytes]
    if suffix in _TEXT or data[:3] == b"ply":
        ways += [damage_words] * 2
    if (structured := _STRUCTURED.get(suffix)) is not None:
        ways += [structured] * 3
    elif data[:2] == b"\x1f\x8b":
        ways += [_inside_gzip]
    elif data[:2] == b"PK":
        ways += [_inside_zip] * 3
    for _ in range(4):
        try:
            damaged = chance.choice(ways)(data, chance)
        except (ValueError, TypeError, OverflowError, yaml.YAMLError):  # values that the format cannot hold
            continue
        if damaged != data:
            return damaged
    return data[: len(data) // 2]


def damage_bytes(data: bytes, chance: random.Random) -> bytes:
    """Cut, flip, overwrite, insert, delete or repeat bytes."""
    if not data:
        return b"\0"
    at, size = chance.randrange(len(data)), chance.choice((1, 2, 4, 16, 64, 1024))
    if chance.random() < 0.3:
        at = chance.randrange(min(len(data), 64))  # headers matter most
    end = min(len(data), at + size)
    match chance.randrange(8):
        case 0:
            return data[:at]
        case 1:
            return data[:at] + bytes([data[at] ^ (1 << chance.randrange(8))]) + data[at + 1 :]
        case 2:
            return data[:at] + chance.randbytes(end - at) + data[end:]
        case 3:
            return data[:at] + chance.randbytes(size) + data[at:]
        case 4:
            return data[:at] + data[end:]
        case 5:
            return data[:end] + data[at:]
        case 6:
            return data[:at] + chance.choice((b"\0", b"\xff")) * (end - at) + data[end:]
    number = chance.choice(ODD_NUMBERS)
    at = min(at - at % chance.choice((1, 2, 4, 8)), len(data))
    return data[:at] + number + data[at + len(number) :]


def damage_words(data: bytes, chance: random.Random) -> bytes:
    """Replace a number of a text, or of a header of text, or swap, drop or repeat one of its lines."""
    text = data[: data.find(b"end_header")] if data[:3] == b"ply" and b"end_header" in data else data
    numbers = list(_NUMBER.finditer(text))
    if numbers and chance.random() < 0.7:
        found = chance.choice(numbers)
        return data[: found.start()] + chance.choice(ODD_WORDS) + data[found.end() :]
    lines = text.split(b"\n")
    index = chance.randrange(len(lines))
    match chance.randrange(4):
        case 0:
            del lines[index]
        case 1:
            lines.insert(index, lines[index])
        case 2:
            lines[index] = lines[index].upper()
        case _:
            lines[index] = b" ".join(lines[index].split(b" ")[::-1])
    return b"\n".join(lines) + data[len(text) :]


def damage_value(value: Any, chance: random.Random) -> Any:
    """Replace, drop or repeat one entry of nested lists and objects; those near the root as often as the others."""
    places = list(_places(value, 0))
    if not places:
        return chance.choice(ODD_VALUES)
    depth = chance.choice(sorted({place[2] for place in places}))
    parent, key, _ = chance.choice([place for place in places if place[2] == depth])
    match chance.randrange(6):
        case 0:
            del parent[key]
        case 1 if isinstance(parent, list):
            parent.insert(key, parent[key])
        case 2:
            parent[key] = [parent[key]]
        case 3 if isinstance(parent[key], str):
            parent[key] = chance.choice((parent[key].upper(), parent[key] + "x", "../" + parent[key], ""))
        case _:
            parent[key] = chance.choice(ODD_VALUES)
    return value


def _places(value: Any, depth: int) -> Iterator[tuple[Any, Any, int]]:
    """Each entry of nested lists and objects: what holds it, its key, its depth."""
    keys = list(value) if isinstance(value, dict) else range(len(value)) if isinstance(value, list) else ()
    for key in keys:
        yield value, key, depth
        yield from _places(value[key], depth + 1)


def _json(data: bytes, chance: random.Random) -> bytes:
    return json.dumps(damage_value(json.loads(data), chance)).encode()


def _json_lines(data: bytes, chance: random.Random) -> bytes:
    lines = data.split(b"\n")
    index = chance.randrange(max(1, len(lines) - 1))
    lines[index] = _json(lines[index], chance)
    return b"\n".join(lines)


def _yaml(data: bytes, chance: random.Random) -> bytes:
    head, mark, rest = data.partition(b"%YAML:1.0\n")  # OpenCV's first line, which is no YAML
    text = rest if mark else head
    return mark + yaml.safe_dump(damage_value(yaml.safe_load(text), chance)).encode()


def _glb(data: bytes, chance: random.Random) -> bytes:
    (size,) = struct.unpack_from("<I", data, 12)
    text, rest = _json(data[20 : 20 + size], chance), data[20 + size :]
    text += b" " * (-len(text) % 4)
    return struct.pack("<4sIIII", b"glTF", 2, 20 + len(text) + len(rest), len(text), 0x4E4F534A) + text + rest


def _inside_gzip(data: bytes, chance: random.Random) -> bytes:
    return gzip.compress(damage_bytes(gzip.decompress(data), chance))


def _inside_zip(data: bytes, chance: random.Random) -> bytes:
    """Damage, drop or rename one member of an archive that is whole again afterwards."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        members = {name: archive.read(name) for name in archive.namelist()}
    name = chance.choice(sorted(members))
    match chance.randrange(8):
        case 0:
            del members[name]
        case 1:
            members[chance.choice(("../" + name, name.upper(), name + "x"))] = members.pop(name)
        case _:
            members[name] = damage(name, members[name], chance)
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for member, content in members.items():
            archive.writestr(member, content)
    return packed.getvalue()


def _array(data: bytes, chance: random.Random) -> bytes:
    """Change the type, the shape or the numbers of an array in the format of numpy."""
    array = np.load(io.BytesIO(data), allow_pickle=False)
    if array.dtype.kind == "U":  # a header
        return _stored(np.array(_json(array.item().encode(), chance).decode()))
    kinds = ("f2", "f4", "f8", "i8", "u1", "c16", "?", "U3", "O", "M8[s]")
    with np.errstate(all="ignore"):
        match chance.randrange(6):
            case 0:
                return _stored(array.astype(chance.choice(kinds)))
            case 1:
                return _stored(array[: chance.randrange(len(array))] if array.ndim and len(array) else array[None])
            case 2:
                return _stored(array.reshape(-1) if chance.random() < 0.5 else array[..., None])
            case 3:
                return _stored(np.swapaxes(array, 0, -1) if array.ndim > 1 else np.zeros(0, array.dtype))
            case _:
                flat = np.atleast_1d(array.copy()).reshape(-1)
                odd = chance.choice((math.nan, math.inf, -math.inf, 1e30, -1.0, 0.0, 255.0, 1e9))
                flat[chance.randrange(max(1, len(flat)))] = np.array(odd).astype(array.dtype)
                return _stored(flat.reshape(array.shape))


def _stored(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.save(stream, array, allow_pickle=True)  # readers refuse objects
    return stream.getvalue()


_STRUCTURED: dict[str, Callable[[bytes, random.Random], bytes]] = {
    ".json": _json,
    ".gltf": _json,
    ".jsonl": _json_lines,
    ".yaml": _yaml,
    ".yml": _yaml,
    ".glb": _glb,
    ".npy": _array,
    ".npz": _inside_zip,
    ".zip": _inside_zip,
    ".sog": _inside_zip,
}
"""Ending to the damage of what a file of it holds."""
