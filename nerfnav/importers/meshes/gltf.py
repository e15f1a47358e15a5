"""glTF 2.0: check the header of a file before anything is decoded."""

import base64
import io
import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

from PIL import Image

from nerfnav.core.glb import ContainerError, chunks
from nerfnav.importers.core.errors import MeshFileError

_KNOWN = {
    "KHR_draco_mesh_compression",
    "KHR_materials_unlit",
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_mesh_quantization",
    "EXT_texture_webp",
    "KHR_texture_transform",
    "KHR_texture_basisu",
    "EXT_meshopt_compression",
    "KHR_meshopt_compression",
}
"""Required extensions that are supported."""
_IGNORED = re.compile(
    r"KHR_materials_\w+|KHR_lights_\w+|EXT_lights_\w+|KHR_xmp\w*|KHR_animation_pointer|KHR_node_visibility"
    r"|MSFT_packing_\w+|EXT_materials_\w+|KHR_audio\w*"
)
"""Extensions for shading, lights and the like, which shape and base colour do not need."""


def parts_of(path: Path, data: bytes) -> tuple[dict[str, Any], bytes]:
    """The header and, of a .glb, the binary chunk. Raises MeshFileError where the file is not a whole one."""
    try:
        text, binary = chunks(data) if path.suffix.lower() == ".glb" else (data, b"")
    except ContainerError as error:
        raise MeshFileError(f"{path} {error}") from error
    return header_of(path, text), binary


def header_of(path: Path, text: bytes) -> dict[str, Any]:
    """The header of glTF. Raises MeshFileError where it is none."""
    try:
        header = json.loads(text)
    except ValueError as error:
        raise MeshFileError(f"{path} is not a whole glTF file: its header is no JSON") from error
    if not isinstance(header, dict) or "asset" not in header:
        raise MeshFileError(f"{path} is not a glTF file: its header has no `asset`")
    if not str(header["asset"].get("version", "")).startswith("2"):
        raise MeshFileError(f"{path} is not glTF 2.0: convert it first, with Blender for example")
    return header


def require_known(path: Path, header: dict[str, Any]) -> None:
    """Raise MeshFileError for extensions that a file requires and that are neither understood nor to be ignored."""
    needed = [str(name) for name in header.get("extensionsRequired", [])]
    unknown = sorted(name for name in needed if name not in _KNOWN and not _IGNORED.fullmatch(name))
    if unknown:
        raise MeshFileError(
            f"{path} cannot be read without {', '.join(unknown)}, which nerfnav does not know: export it without"
        )


def check(path: Path, header: dict[str, Any], read: Callable[[dict[str, Any]], bytes]) -> None:
    """Raise MeshFileError for textures that cannot be decoded.

    `read` gives the bytes of a buffer or an image that is not in a buffer, by its entry in the header.
    """
    for index, image in enumerate(header.get("images", [])):
        try:
            data = _view(header, image["bufferView"], read) if "bufferView" in image else read(image)
        except (KeyError, IndexError, TypeError, ValueError) as error:
            raise MeshFileError(f"{path} is damaged: its header does not say where texture {index} is") from error
        try:
            Image.open(io.BytesIO(data))
        except Exception as error:  # whatever a picture of unknown origin makes its reader raise
            raise MeshFileError(f"{path} has a texture, number {index}, that is no picture that can be read") from error


def decode_embedded(entry: dict[str, Any]) -> bytes | None:
    """The bytes that an entry of the header holds in itself; None where it names a file."""
    uri = str(entry["uri"])
    return base64.b64decode(uri.partition(",")[2], validate=False) if uri.startswith("data:") else None


def _view(header: dict[str, Any], index: int, read: Callable[[dict[str, Any]], bytes]) -> bytes:
    view = header["bufferViews"][index]
    start = view.get("byteOffset", 0)
    return read(header["buffers"][view["buffer"]])[start : start + view["byteLength"]]


def is_linear(header: dict[str, Any]) -> bool:
    """True where plain colours are linear light, as in the standard; trimesh writes them unchanged, in sRGB."""
    return "trimesh" not in str(header["asset"].get("generator", ""))
