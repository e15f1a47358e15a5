"""glTF arrays: buffers, buffer views and accessors as numpy arrays.

    accessor   count elements of a view, `byteStride` apart; sparse ones replace single elements
    normalized c / max for unsigned integers, max(c / max, -1) for signed ones
    meshopt    buffer views that are decoded first (the package `meshopt`, an extra)
"""

import base64
import binascii
import importlib
import urllib.parse
from typing import Any

import numpy as np
from jaxtyping import Float64, Shaped

from nerfnav.importers.meshes.gltf_header import MESHOPT, Accessor, Buffer, Header, MeshoptView, extension, pick
from nerfnav.importers.meshes.parts import DamagedMeshError
from nerfnav.importers.meshes.resolver import FolderResolver

_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT2": 4, "MAT3": 9, "MAT4": 16}
_MOST = 200_000_000
"""Elements of an accessor that has no data of its own: as many can be allocated."""


class GltfArrays:
    """Arrays of a file by their index, each decoded at most once."""

    def __init__(self, header: Header, chunk: bytes, beside: FolderResolver) -> None:
        """`chunk` is the data of a .glb; `beside` reads the other files."""
        self._header, self._chunk, self._beside = header, chunk, beside
        self._buffers: dict[int, bytes] = {}
        self._views: dict[int, bytes] = {}

    def numbers(self, index: int, types: str, where: str) -> Float64[np.ndarray, "n k"]:
        """The elements of an accessor whose type is among `types`, integers normalized where it says so."""
        return normalize(self.stored(index, types, where), self._accessor(index, where).normalized)

    def stored(self, index: int, types: str, where: str) -> Shaped[np.ndarray, "n k"]:
        """The elements of an accessor as they are stored. Raises DamagedMeshError where the file lacks some."""
        accessor = self._accessor(index, where)
        if accessor.type not in types.split():
            raise DamagedMeshError(f"has accessors[{index}] of type {accessor.type}, where {where} needs {types}")
        width = _WIDTHS[accessor.type]
        if accessor.buffer_view is not None:
            found = self._rows(accessor.buffer_view, accessor, width, f"accessors[{index}]")
        elif accessor.count > _MOST:
            raise DamagedMeshError(f"has accessors[{index}] with {accessor.count} elements and no data")
        else:
            found = np.zeros((accessor.count, width), _TYPES[accessor.component_type])
        return found if accessor.sparse is None else self._replaced(found, accessor, f"accessors[{index}].sparse")

    def view(self, index: int, where: str) -> bytes:
        """The bytes of a buffer view."""
        if index not in self._views:
            view = pick(self._header.buffer_views, index, "bufferViews", where)
            where = f"bufferViews[{index}]"
            packing = (extension(view, name, MeshoptView, where) for name in MESHOPT)
            packed = next((found for found in packing if found is not None), None)
            if packed is None:
                self._views[index] = self._slice(view.buffer, view.byte_offset, view.byte_length, where)
            else:
                self._views[index] = self._unpacked(packed, where)
        return self._views[index]

    def _accessor(self, index: int, where: str) -> Accessor:
        return pick(self._header.accessors, index, "accessors", where)

    def _rows(self, view: int, accessor: Accessor, width: int, where: str) -> np.ndarray:
        kind = np.dtype(_TYPES[accessor.component_type])
        data, offset = self.view(view, where), accessor.byte_offset
        stride = self._header.buffer_views[view].byte_stride or width * kind.itemsize
        needed = offset + (accessor.count - 1) * stride + width * kind.itemsize if accessor.count else 0
        if stride < width * kind.itemsize or needed > len(data):
            raise DamagedMeshError(
                f"is damaged or cut off: {where} needs {needed} bytes {stride} apart, and bufferViews[{view}] has "
                f"{len(data)}"
            )
        return np.ndarray((accessor.count, width), kind, data, offset, (stride, kind.itemsize))

    def _replaced(self, found: np.ndarray, accessor: Accessor, where: str) -> np.ndarray:
        sparse = accessor.sparse
        assert sparse is not None
        positions = Accessor(
            component_type=sparse.indices.component_type,
            count=sparse.count,
            type="SCALAR",
            byte_offset=sparse.indices.byte_offset,
        )
        values = Accessor(
            component_type=accessor.component_type,
            count=sparse.count,
            type=accessor.type,
            byte_offset=sparse.values.byte_offset,
        )
        index = self._rows(sparse.indices.buffer_view, positions, 1, f"{where}.indices")[:, 0]
        if len(index) and index.max() >= len(found):
            raise DamagedMeshError(f"is damaged: {where} replaces element {index.max()} of {len(found)}")
        found = found.copy()
        found[index] = self._rows(sparse.values.buffer_view, values, found.shape[1], f"{where}.values")
        return found

    def _slice(self, buffer: int, start: int, length: int, where: str) -> bytes:
        if buffer not in self._buffers:
            self._buffers[buffer] = self._read(pick(self._header.buffers, buffer, "buffers", where), buffer)
        data = self._buffers[buffer][start : start + length]
        if len(data) != length:
            raise DamagedMeshError(
                f"is cut off: {where} needs {start + length} bytes, and buffers[{buffer}] has "
                f"{len(self._buffers[buffer])}"
            )
        return data

    def _read(self, buffer: Buffer, index: int) -> bytes:
        if buffer.uri is not None:
            inside = decode_data_uri(buffer.uri, f"buffers[{index}].uri")
            return self._beside.get(buffer.uri) if inside is None else inside
        if index or not self._chunk:
            raise DamagedMeshError(f"is damaged: buffers[{index}] has no uri, and no data stands beside the header")
        return self._chunk

    def _unpacked(self, packed: MeshoptView, where: str) -> bytes:
        stored = self._slice(packed.buffer, packed.byte_offset, packed.byte_length, where)
        try:
            meshopt: Any = importlib.import_module("meshopt")  # few files need it
        except ImportError as error:
            raise DamagedMeshError(
                "is compressed with meshopt, and what reads that is not installed: `pip install 'nerfnav[meshopt]'`, "
                "or export it without"
            ) from error
        size = packed.count * packed.byte_stride
        if size > _MOST:
            raise DamagedMeshError(f"is damaged: {where} would decode to {size} bytes")
        try:
            rows = meshopt.decode_gltf_buffer(stored, packed.count, packed.byte_stride, packed.mode, packed.filter)
        except Exception as error:  # whatever the decoder raises over foreign bytes
            raise DamagedMeshError(f"is damaged: {where} cannot be decoded by meshopt") from error
        data = np.ascontiguousarray(rows).tobytes()
        if len(data) != size:
            raise DamagedMeshError(f"is damaged: {where} decodes to {len(data)} bytes of {size}")
        return data


def normalize(values: Shaped[np.ndarray, "n k"], is_normalized: bool) -> Float64[np.ndarray, "n k"]:
    """Numbers of an accessor's integers, which fill -1 to 1 or 0 to 1 where it is normalized."""
    if not is_normalized or values.dtype.kind == "f":
        return values.astype(np.float64)
    return np.maximum(values / float(np.iinfo(values.dtype).max), -1.0)


def decode_data_uri(uri: str, where: str) -> bytes | None:
    """The bytes that a data: URI holds; None for one that names a file. Raises DamagedMeshError for wrong base64."""
    if not uri.startswith("data:"):
        return None
    kind, _, text = uri.partition(",")
    if not kind.lower().endswith(";base64"):
        return urllib.parse.unquote_to_bytes(text)
    try:
        return base64.b64decode(urllib.parse.unquote(text), validate=False)
    except (binascii.Error, ValueError) as error:
        raise DamagedMeshError(f"is damaged: {where} is no base64") from error
