"""glTF 2.0 header: typed records of its JSON, and the extensions that are applied, ignored or refused.

Source: Khronos Group, glTF 2.0 specification, and the registry of its extensions.
"""

import json
import re
from collections.abc import Iterator, Sequence
from typing import Annotated, Any, Literal, TypeVar

import msgspec
from msgspec import Meta, Struct

from nerfnav.importers.meshes.parts import DamagedMeshError

Index = Annotated[int, Meta(ge=0, lt=1 << 31)]
Size = Annotated[int, Meta(ge=0, lt=1 << 40)]
Vector2 = tuple[float, float]
Vector3 = tuple[float, float, float]
Vector4 = tuple[float, float, float, float]
Matrix4 = Annotated[list[float], Meta(min_length=16, max_length=16)]
ComponentType = Literal[5120, 5121, 5122, 5123, 5125, 5126]
ElementType = Literal["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"]


class Record(Struct, rename="camel"):
    """Object of the header; its keys that no field names have no bearing on shape and base colour."""

    extensions: dict[str, Any] = {}


class Asset(Record):
    """Version of the format, and the program that wrote the file."""

    version: str = ""
    generator: str = ""


class Buffer(Record, kw_only=True):
    """Bytes: in a file, in the header or, without a uri, in the chunk of a .glb."""

    byte_length: Size
    uri: str | None = None


class BufferView(Record, kw_only=True):
    """Section of a buffer; a stride of 0 stands for elements without space between them."""

    buffer: Index
    byte_length: Size
    byte_offset: Size = 0
    byte_stride: Size = 0


class SparseIndices(Record, kw_only=True):
    """Numbers of the elements that a sparse accessor replaces."""

    buffer_view: Index
    component_type: Literal[5121, 5123, 5125]
    byte_offset: Size = 0


class SparseValues(Record, kw_only=True):
    """Elements that take their place."""

    buffer_view: Index
    byte_offset: Size = 0


class Sparse(Record, kw_only=True):
    """Replaced elements of an accessor."""

    count: Size
    indices: SparseIndices
    values: SparseValues


class Accessor(Record, kw_only=True):
    """Array in a buffer view; without one, and where it is not sparse, of zeros."""

    component_type: ComponentType
    count: Size
    type: ElementType
    buffer_view: Index | None = None
    byte_offset: Size = 0
    normalized: bool = False
    sparse: Sparse | None = None


class Primitive(Record, kw_only=True):
    """Faces of one material."""

    attributes: dict[str, Index]
    indices: Index | None = None
    material: Index | None = None
    mode: Annotated[int, Meta(ge=0, le=6)] = 4
    targets: list[dict[str, Index]] = []


class Mesh(Record, kw_only=True):
    """Primitives, and the weights of their morph targets."""

    primitives: list[Primitive]
    weights: list[float] = []
    name: str = ""


class Node(Record):
    """Node of the scene graph."""

    children: list[Index] = []
    mesh: Index | None = None
    skin: Index | None = None
    matrix: Matrix4 | None = None
    translation: Vector3 = (0.0, 0.0, 0.0)
    rotation: Vector4 = (0.0, 0.0, 0.0, 1.0)
    scale: Vector3 = (1.0, 1.0, 1.0)
    weights: list[float] = []
    name: str = ""


class Scene(Record):
    """Roots of the nodes that are shown together."""

    nodes: list[Index] = []


class Skin(Record, kw_only=True):
    """Joints that move the vertices of a mesh."""

    joints: list[Index]
    inverse_bind_matrices: Index | None = None


class Image(Record):
    """Picture in a file, in the header or in a buffer view."""

    uri: str | None = None
    buffer_view: Index | None = None


class Texture(Record):
    """Use of a picture."""

    source: Index | None = None


class TextureInfo(Record, kw_only=True):
    """Texture of a material, and the set of coordinates that places it."""

    index: Index
    tex_coord: Index = 0


class MetallicRoughness(Record):
    """Base colour, in linear light."""

    base_color_texture: TextureInfo | None = None
    base_color_factor: Vector4 = (1.0, 1.0, 1.0, 1.0)


class Material(Record):
    """Material, of which only the base colour is used."""

    pbr_metallic_roughness: MetallicRoughness | None = None


class Header(Record, kw_only=True):
    """The JSON of a file."""

    asset: Asset
    scene: Index | None = None
    scenes: list[Scene] = []
    nodes: list[Node] = []
    meshes: list[Mesh] = []
    accessors: list[Accessor] = []
    buffer_views: list[BufferView] = []
    buffers: list[Buffer] = []
    images: list[Image] = []
    textures: list[Texture] = []
    materials: list[Material] = []
    skins: list[Skin] = []
    extensions_used: list[str] = []
    extensions_required: list[str] = []


class DracoPrimitive(Struct, rename="camel"):
    """KHR_draco_mesh_compression: all of a primitive in one buffer view, attributes by their number there."""

    buffer_view: Index
    attributes: dict[str, Index]


class MeshoptView(Struct, rename="camel"):
    """EXT_meshopt_compression: the stored bytes of a buffer view."""

    buffer: Index
    byte_length: Size
    byte_stride: Annotated[int, Meta(ge=1, le=256)]
    count: Size
    mode: Literal["ATTRIBUTES", "TRIANGLES", "INDICES"]
    byte_offset: Size = 0
    filter: str = "NONE"


class Instancing(Struct):
    """EXT_mesh_gpu_instancing: translation, rotation and scale of each instance of a node's mesh."""

    attributes: dict[str, Index]


class Visibility(Struct):
    """KHR_node_visibility: a node that is not visible hides those below it, too."""

    visible: bool = True


class TextureTransform(Struct, rename="camel"):
    """KHR_texture_transform: scale, rotation [rad] and offset of texture coordinates."""

    offset: Vector2 = (0.0, 0.0)
    rotation: float = 0.0
    scale: Vector2 = (1.0, 1.0)
    tex_coord: Index | None = None


class OtherSource(Struct):
    """Picture of a texture in a format that glTF 2.0 does not have: KTX2, WebP, AVIF, DDS."""

    source: Index


class SpecularGlossiness(Struct, rename="camel"):
    """KHR_materials_pbrSpecularGlossiness: the older description of colour."""

    diffuse_factor: Vector4 = (1.0, 1.0, 1.0, 1.0)
    diffuse_texture: TextureInfo | None = None


DRACO, INSTANCING, VISIBILITY = "KHR_draco_mesh_compression", "EXT_mesh_gpu_instancing", "KHR_node_visibility"
TRANSFORM, GLOSSINESS = "KHR_texture_transform", "KHR_materials_pbrSpecularGlossiness"
MESHOPT = ("EXT_meshopt_compression", "KHR_meshopt_compression")
SOURCES = ("EXT_texture_webp", "EXT_texture_avif", "KHR_texture_basisu", "MSFT_texture_dds")
_APPLIED = {DRACO, INSTANCING, VISIBILITY, TRANSFORM, GLOSSINESS, *MESHOPT, *SOURCES, "KHR_mesh_quantization"}
_IGNORED = re.compile(
    r"KHR_materials_\w+|KHR_lights_\w+|EXT_lights_\w+|KHR_xmp\w*|KHR_animation_pointer|MSFT_packing_\w+"
    r"|EXT_materials_\w+|KHR_audio\w*|EXT_mesh_features|EXT_instance_features|EXT_structural_metadata"
    r"|EXT_mesh_manifold|EXT_mesh_primitive_edge_visibility|FB_ngon_encoding|MSFT_lod|CESIUM_primitive_outline"
    r"|KHR_node_selectability|KHR_node_hoverability|KHR_interactivity|KHR_physics\w*"
)
"""Extensions for shading, lights, data and behaviour, which shape and base colour do not need."""
_SHAPING = re.compile(
    r"mesh|geometr|instanc|visib|compress|quantiz|subdiv|displac|skin|morph|splat|transform", re.IGNORECASE
)
"""Words in the name of an extension by which it changes what stands where."""

S = TypeVar("S")


def read_header(text: bytes) -> tuple[Header, list[str]]:
    """The header of a file, and notes on it. Raises DamagedMeshError where it is none or needs what is not known."""
    try:
        content = json.loads(text.decode(json.detect_encoding(text)))
    except (ValueError, RecursionError) as error:
        raise DamagedMeshError("is not a whole glTF file: its header is no JSON") from error
    if not isinstance(content, dict) or "asset" not in content:
        raise DamagedMeshError("is not a glTF file: its header has no `asset`")
    if not convert(content["asset"], Asset, "asset").version.startswith("2"):
        raise DamagedMeshError("is not glTF 2.0: convert it first, with Blender for example")
    header = convert(content, Header, "")
    shaping = {
        name
        for records in (header.buffers, header.buffer_views, header.accessors, header.meshes, _primitives(header))
        for record in records
        for name in record.extensions
    }
    shaping |= set(filter(_SHAPING.search, header.extensions_used))
    unknown = _unknown({*header.extensions_required, *shaping})
    if unknown:
        raise DamagedMeshError(
            f"cannot be read without {', '.join(unknown)}, which nerfnav does not know: export it without"
        )
    others = _unknown(header.extensions_used)
    return header, [f"the extensions {', '.join(others)} are not known, and ignored"] if others else []


def _primitives(header: Header) -> Iterator[Primitive]:
    return (primitive for mesh in header.meshes for primitive in mesh.primitives)


def _unknown(names: Sequence[str] | set[str]) -> list[str]:
    return sorted({name for name in names if name not in _APPLIED and not _IGNORED.fullmatch(name)})


def convert(content: Any, kind: type[S], where: str) -> S:
    """Convert what stands at `where` in the header. Raises DamagedMeshError, with the key's path, where it is wrong."""
    try:
        return msgspec.convert(content, kind)
    except msgspec.ValidationError as error:
        reason, _, place = str(error).partition(" - at `$")
        at = f"{where}{place.rstrip('`')}".removeprefix(".") or "its JSON"
        reason = f"{reason[:1].lower()}{reason[1:]}".replace("`", "")
        raise DamagedMeshError(f"has a wrong value in its header, at {at}: {reason}") from error
    except (RecursionError, OverflowError, UnicodeError) as error:
        raise DamagedMeshError("has a header with a number or a text that is no value") from error


def extension(record: Record, name: str, kind: type[S], where: str) -> S | None:
    """An extension of a record; None where it has none of that name."""
    content = record.extensions.get(name)
    return None if content is None else convert(content, kind, f"{where}.extensions.{name}")


def pick(records: Sequence[S], index: int, name: str, where: str) -> S:
    """The record of that index in the list `name`. Raises DamagedMeshError where `where` names one beyond its end."""
    if index >= len(records):
        raise DamagedMeshError(f"is damaged: {where} names {name}[{index}], and there are {len(records)}")
    return records[index]
