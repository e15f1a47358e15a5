"""glTF files as .glb that needs nothing but glTF 2.0."""

from pathlib import Path
from typing import Any

from nerfnav.importers.meshes import gltf
from nerfnav.importers.meshes.beside import Beside
from nerfnav.importers.meshes.declared import gltf_parts
from nerfnav.importers.meshes.gltf_plain import Plain


def plain_gltf(path: Path, data: bytes, beside: Beside) -> bytes | None:
    """The file as a .glb that needs nothing but glTF 2.0; None where it is that already."""
    header, binary = gltf_parts(path, data)

    def read(entry: dict[str, Any]) -> bytes:
        if "uri" not in entry:
            return binary
        inside = gltf.embedded(entry)
        return beside.get(entry["uri"]) if inside is None else inside

    plain = Plain(path, header, read)
    plain.apply()
    gltf.check(path, plain.header, read)
    return plain.packed()
