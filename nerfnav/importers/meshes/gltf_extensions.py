"""glTF extensions: apply those that change geometry or texture coordinates, so that any reader can load the file.

    EXT_meshopt_compression   buffer views are decoded (the package `meshopt`, an extra)
    KHR_texture_transform     u' = R S u + t is applied to the coordinates of the base colour's texture, with
                              R = [[cos r, sin r], [-sin r, cos r]], as they count down the picture
    KHR_texture_basisu        KTX2 textures give way to the ordinary ones that files may have beside them

Textures that are missing are replaced by `NO_TEXTURE`, which stands for grey, and a note is added.
"""

import base64
import copy
import importlib
import io
import math
import struct
from collections.abc import Callable
from typing import Any

import numpy as np
from PIL import Image

from nerfnav.core import glb
from nerfnav.importers.core.errors import MeshFileError, first_line

NO_TEXTURE = 100
"""sRGB brightness of the picture that stands for none; trimesh gives the same to coordinates without a material."""
_MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
_TRANSFORM, _BASISU, _DRACO = "KHR_texture_transform", "KHR_texture_basisu", "KHR_draco_mesh_compression"
_TYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
Read = Callable[[dict[str, Any]], bytes]


class PlainGltf:
    """A glTF file in the making: its header, and the bytes of its buffer views where they are not as stored."""

    def __init__(self, path: object, header: dict[str, Any], read: Read) -> None:
        """`read` gives the bytes of a buffer or of an image with a uri, by its entry; it raises FileNotFoundError."""
        self.header = copy.deepcopy(header)
        self._path, self._read = path, read
        self._made: dict[int, bytes] = {}
        self._buffers: dict[int, bytes] = {}
        self._changed = False

    def apply(self) -> None:
        """Apply what is to be applied. Raises MeshFileError, in one sentence, where the file does not allow it."""
        try:
            self._replace_missing_images()
            self._leave_basisu()
            self._decode_meshopt()
            self._transform_coordinates()
        except (KeyError, IndexError, TypeError, ValueError, AttributeError, struct.error) as error:
            raise MeshFileError(
                f"{self._path} is damaged or cut off: its header does not fit its data ({first_line(error)})"
            ) from error

    def packed(self) -> bytes | None:
        """All of it as one .glb; None where nothing was changed."""
        if not self._changed:
            return None
        binary, views = bytearray(), []
        for index, view in enumerate(self.header.get("bufferViews", [])):
            data = self.view(index)
            kept = {name: view[name] for name in ("byteStride", "target") if name in view}
            views.append({"buffer": 0, "byteOffset": len(binary), "byteLength": len(data), **kept})
            binary += data + bytes(-len(data) % 8)
        self.header |= {"bufferViews": views, "buffers": [{"byteLength": len(binary)}]}
        return glb.packed(self.header, bytes(binary))

    def view(self, index: int) -> bytes:
        """The bytes of a buffer view."""
        if index in self._made:
            return self._made[index]
        view = self.header["bufferViews"][index]
        return self._slice(view["buffer"], view.get("byteOffset", 0), view["byteLength"])

    def _slice(self, buffer: int, start: int, length: int) -> bytes:
        if buffer not in self._buffers:
            self._buffers[buffer] = self._read(self.header["buffers"][buffer])
        data = self._buffers[buffer][start : start + length]
        if start < 0 or len(data) != length:
            raise MeshFileError(
                f"{self._path} is cut off: a buffer ends at byte {len(self._buffers[buffer])}, and {start + length} "
                "are needed"
            )
        return data

    def _replace_missing_images(self) -> None:
        for image in self.header.get("images", []):
            if "bufferView" in image:
                continue
            try:
                self._read(image)
            except FileNotFoundError:
                image |= _no_picture()
                self._changed = True

    def _leave_basisu(self) -> None:
        """Let textures have the ordinary picture that stands beside a KTX2 one."""
        for texture in self.header.get("textures", []):
            packed = texture.get("extensions", {}).pop(_BASISU, None)
            if packed is None:
                continue
            if "source" not in texture:
                raise MeshFileError(
                    f"{self._path} has its textures as KTX2 alone, which no library here reads: export it with PNG or "
                    f"JPEG textures (with KTX-Software, `ktx extract` makes a PNG of each)"
                )
            self.header["images"][packed["source"]] = _no_picture()  # nothing needs it any more
            self._changed = True

    def _decode_meshopt(self) -> None:
        for index, view in enumerate(self.header.get("bufferViews", [])):
            found = [view.get("extensions", {}).get(name) for name in _MESHOPT]
            packing = next((entry for entry in found if entry is not None), None)
            if packing is None:
                continue
            stored = self._slice(packing["buffer"], packing.get("byteOffset", 0), packing["byteLength"])
            count, stride = int(packing["count"]), int(packing["byteStride"])
            rows = self._meshopt()(stored, count, stride, packing["mode"], packing.get("filter", "NONE"))
            data = np.ascontiguousarray(rows).tobytes()
            if len(data) != count * stride:
                raise ValueError(f"buffer view {index} decodes to {len(data)} bytes of {count * stride}")
            self._made[index] = data
            view["extensions"] = {name: own for name, own in view["extensions"].items() if name not in _MESHOPT}
            self._changed = True

    def _meshopt(self) -> Callable[..., np.ndarray]:
        try:
            meshopt: Any = importlib.import_module("meshopt")  # few files need it
        except ImportError as error:
            raise MeshFileError(
                f"{self._path} is compressed with meshopt, and what reads that is not installed: "
                "`pip install 'nerfnav[meshopt]'`, or export it without"
            ) from error
        return meshopt.decode_gltf_buffer

    def _transform_coordinates(self) -> None:
        done: dict[tuple[object, ...], int] = {}
        for mesh in self.header.get("meshes", []):
            for primitive in mesh["primitives"]:
                info = self._base_texture(primitive.get("material"))
                transform = info.get("extensions", {}).get(_TRANSFORM, {})
                chosen = transform.get("texCoord", info.get("texCoord", 0))
                source = primitive["attributes"].get(f"TEXCOORD_{chosen}")
                if source is None or (not transform and chosen == 0):
                    continue
                if _DRACO in primitive.get("extensions", {}):
                    raise MeshFileError(
                        f"{self._path} has transformed textures on Draco-compressed parts: export it without either"
                    )
                offset, scale = transform.get("offset", (0.0, 0.0)), transform.get("scale", (1.0, 1.0))
                how = (*offset, *scale, transform.get("rotation", 0.0))
                if (source, how) not in done:
                    done[source, how] = self._add_coordinates(_transformed(self._coordinates(source), *how))
                primitive["attributes"]["TEXCOORD_0"] = done[source, how]
                self._changed = True

    def _base_texture(self, material: int | None) -> dict[str, Any]:
        """Texture entry of a material's base colour; empty where there is none."""
        if material is None:
            return {}
        entry = self.header["materials"][material]
        older = entry.get("extensions", {}).get("KHR_materials_pbrSpecularGlossiness", {}).get("diffuseTexture")
        return entry.get("pbrMetallicRoughness", {}).get("baseColorTexture") or older or {}

    def _coordinates(self, index: int) -> np.ndarray:
        """Texture coordinates (n, 2) of an accessor."""
        accessor = self.header["accessors"][index]
        kind, count = np.dtype(_TYPES[accessor["componentType"]]), accessor["count"]
        view = self.header["bufferViews"][accessor["bufferView"]]
        stride = view.get("byteStride", 2 * kind.itemsize)
        data = self.view(accessor["bufferView"])
        values = np.ndarray((count, 2), kind, data, accessor.get("byteOffset", 0), (stride, kind.itemsize))
        share = np.iinfo(kind).max if accessor.get("normalized") else 1
        return values.astype(np.float64) / share

    def _add_coordinates(self, values: np.ndarray) -> int:
        """The accessor of new texture coordinates (n, 2)."""
        data = values.astype("<f4").tobytes()
        views, accessors = self.header["bufferViews"], self.header["accessors"]
        self._made[len(views)] = data
        views.append({"buffer": 0, "byteLength": len(data)})
        accessors.append({"bufferView": len(views) - 1, "componentType": 5126, "count": len(values), "type": "VEC2"})
        return len(accessors) - 1


def _no_picture() -> dict[str, str]:
    """The entry of an image that stands for none."""
    file = io.BytesIO()
    Image.new("RGB", (1, 1), (NO_TEXTURE,) * 3).save(file, "PNG")
    uri = "data:image/png;base64," + base64.b64encode(file.getvalue()).decode()
    return {"uri": uri, "mimeType": "image/png"}


def _transformed(uv: np.ndarray, tx: float, ty: float, sx: float, sy: float, angle: float) -> np.ndarray:
    """Texture coordinates (n, 2) scaled, turned by an angle [rad] and moved."""
    cos, sin = math.cos(angle), math.sin(angle)
    return uv * (sx, sy) @ np.array([[cos, -sin], [sin, cos]]) + (tx, ty)
