"""glTF 2.0: the parts of a file as they stand in its scene.

    nodes      world = world of the parent times T R S; hidden ones (KHR_node_visibility) hide those below them
    instances  world times T R S of each instance (EXT_mesh_gpu_instancing)
    morphs     x = x0 + sum of weight times target, by the weights of the node, else of the mesh
    skins      x = sum of weight times world of the joint times inverse bind matrix, in the pose of the nodes
    textures   u' = R S u + t (KHR_texture_transform), R = [[cos r, sin r], [-sin r, cos r]], down the picture

Animations are not played: what moves stands as the nodes of the file have it.
"""

import math
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int, Shaped

from nerfnav.core.extras import import_extra
from nerfnav.core.glb import ContainerError, chunks
from nerfnav.importers.meshes.gltf_arrays import GltfArrays, decode_data_uri, normalize
from nerfnav.importers.meshes.gltf_header import (
    DRACO,
    GLOSSINESS,
    INSTANCING,
    SOURCES,
    TRANSFORM,
    VISIBILITY,
    DracoPrimitive,
    Header,
    Instancing,
    Mesh,
    MetallicRoughness,
    Node,
    OtherSource,
    Primitive,
    SpecularGlossiness,
    TextureInfo,
    TextureTransform,
    Visibility,
    extension,
    pick,
    read_header,
)
from nerfnav.importers.meshes.parts import GREY, LARGEST, DamagedMeshError, Part, srgb_bytes
from nerfnav.importers.meshes.resolver import FolderResolver, PictureError, decode_picture
from nerfnav.world.surface import Image as Pixels

_MOST_FACES = 50_000_000
"""Faces, instances counted, that fit in memory."""
Corners = Shaped[np.ndarray, "n k"]


def read_gltf(path: Path, data: bytes, beside: FolderResolver) -> list[Part]:
    """The parts of a .glb or .gltf, in metres and Y-up. Raises DamagedMeshError where it is not whole."""
    try:
        text, chunk = chunks(data) if path.suffix.lower() == ".glb" else (data, b"")
    except ContainerError as error:
        raise DamagedMeshError(str(error)) from error
    header, notes = read_header(text)
    beside.notes += notes
    return list(_Gltf(header, chunk, beside).parts())


class _Paint(NamedTuple):
    """Base colour of a material, and the texture coordinates of its picture."""

    factor: Float[np.ndarray, " 3"]
    """Colour, in the light that the file has."""
    picture: Pixels | None
    """Its texture, where it can be had."""
    is_grey: bool
    """True where it has a texture that cannot be had."""
    coordinates: str = "TEXCOORD_0"
    """Attribute that places the texture."""
    transform: TextureTransform | None = None
    """Change of these coordinates."""


class _Gltf:
    """A file in the making: its nodes in the world, and its parts."""

    def __init__(self, header: Header, chunk: bytes, beside: FolderResolver) -> None:
        self._header, self._beside = header, beside
        self._arrays = GltfArrays(header, chunk, beside)
        # trimesh writes plain colours unchanged, in sRGB, against the standard
        self._is_linear = "trimesh" not in header.asset.generator
        self._worlds = self._world_matrices()
        self._pictures: dict[int, Pixels | PictureError] = {}
        self._paints: dict[int | None, _Paint] = {}
        self._decoded: dict[int, tuple[np.ndarray, dict[int, np.ndarray]]] = {}

    def parts(self) -> Iterator[Part]:
        """The parts of the scene, one for each primitive of each instance."""
        faces = 0
        for number in self._shown():
            node, where = self._header.nodes[number], f"nodes[{number}]"
            if node.mesh is None:
                continue
            mesh = pick(self._header.meshes, node.mesh, "meshes", where)
            instances = self._worlds[number] @ self._instances(node, where)
            for index, primitive in enumerate(mesh.primitives):
                place = f"meshes[{node.mesh}].primitives[{index}]"
                if primitive.mode < 4:
                    self._beside.note("its points and lines are left out: they are no surfaces")
                    continue
                if "POSITION" not in primitive.attributes:
                    self._beside.note(f"{place} has no positions, so it is left out")
                    continue
                part = self._part(node, mesh, primitive, place)
                faces += len(instances) * len(part.faces)
                if faces > _MOST_FACES:
                    raise DamagedMeshError(f"has more than {_MOST_FACES} faces, its instances counted")
                if _is_skinned(node, primitive):  # its vertices are in the world already
                    yield part
                else:
                    yield from (part.moved_by(matrix) for matrix in instances)

    def _world_matrices(self) -> Float[np.ndarray, "n 4 4"]:
        """The pose of each node in the world."""
        nodes = self._header.nodes
        parents: dict[int, int] = {}
        for number, node in enumerate(nodes):
            for child in node.children:
                pick(nodes, child, "nodes", f"nodes[{number}].children")
                if parents.setdefault(child, number) != number:
                    raise DamagedMeshError(
                        f"is damaged: nodes[{child}] has two parents, nodes[{parents[child]}] and nodes[{number}]"
                    )
        reached = [number for number in range(len(nodes)) if number not in parents]
        worlds = np.tile(np.eye(4), (len(nodes), 1, 1))
        for number in reached:
            own = _matrix_of(nodes[number])
            worlds[number] = worlds[parents[number]] @ own if number in parents else own
            reached += nodes[number].children
        if len(reached) < len(nodes):
            raise DamagedMeshError("is damaged: some of its nodes are their own ancestors")
        wrong = np.flatnonzero(~(np.abs(worlds) < LARGEST).all((1, 2)))
        if len(wrong):
            raise DamagedMeshError(f"is damaged: nodes[{wrong[0]}] has a pose that is not of finite numbers")
        return worlds

    def _shown(self) -> list[int]:
        """The visible nodes of the scene that is shown first."""
        if not self._header.scenes:
            raise DamagedMeshError("has no scene, so nothing of it stands anywhere: export it with a scene")
        scene = pick(self._header.scenes, self._header.scene or 0, "scenes", "scene")
        queue, shown = list(dict.fromkeys(scene.nodes)), []
        for number in queue:
            node = pick(self._header.nodes, number, "nodes", "the scene")
            visibility = extension(node, VISIBILITY, Visibility, f"nodes[{number}]")
            if visibility is None or visibility.visible:
                shown.append(number)
                queue += node.children
        return list(dict.fromkeys(shown))

    def _instances(self, node: Node, where: str) -> Float[np.ndarray, "n 4 4"]:
        """Poses of a node's mesh, relative to the node."""
        found = extension(node, INSTANCING, Instancing, where)
        if found is None:
            return np.eye(4)[None]
        where = f"{where}.extensions.{INSTANCING}.attributes"
        values = {
            name: self._arrays.numbers(found.attributes[name], kind, f"{where}.{name}")
            for name, kind in (("TRANSLATION", "VEC3"), ("ROTATION", "VEC4"), ("SCALE", "VEC3"))
            if name in found.attributes
        }
        counts = {len(rows) for rows in values.values()}
        if len(counts) != 1:
            raise DamagedMeshError(f"is damaged: {where} has {sorted(counts)} instances, in place of one number")
        (count,) = counts
        translation = values.get("TRANSLATION", np.zeros((count, 3)))
        rotation = values.get("ROTATION", np.tile([0.0, 0.0, 0.0, 1.0], (count, 1)))
        return _compose(translation, rotation, values.get("SCALE", np.ones((count, 3))))

    def _part(self, node: Node, mesh: Mesh, primitive: Primitive, where: str) -> Part:
        """A primitive in its node's own axes or, where it has a skin, in the world."""
        vertices = self._attribute(primitive, "POSITION", "VEC3", where)
        vertices = self._morphed(vertices, node.weights or mesh.weights, primitive, where)
        if node.skin is not None and _is_skinned(node, primitive):
            vertices = self._skinned(vertices, node.skin, primitive, where)
        faces = self._faces(primitive, len(vertices), where)
        paint = self._paint(primitive.material)
        uv = None
        if paint.picture is not None and paint.coordinates in primitive.attributes:
            uv = self._attribute(primitive, paint.coordinates, "VEC2", where)
            uv = _transformed(uv, paint.transform) if paint.transform else uv
            uv = (uv * (1, -1) + (0, 1))[faces]
        tint = self._tint(primitive, paint, faces, where)
        return Part(vertices, faces, tint, uv, paint.picture, node.name or mesh.name)

    def _tint(self, primitive: Primitive, paint: _Paint, faces: np.ndarray, where: str) -> np.ndarray:
        """sRGB (f, 3, 3) at the corners of faces: the material's factor times the colours of vertices."""
        has_colors = "COLOR_0" in primitive.attributes
        if paint.is_grey or (primitive.material is None and not has_colors):
            return np.full((len(faces), 3, 3), GREY, np.uint8)
        tint = np.broadcast_to(srgb_bytes(paint.factor[None], self._is_linear), (len(faces), 3, 3))
        if has_colors:
            colors = self._attribute(primitive, "COLOR_0", "VEC3 VEC4", where)
            # as sRGB is nearly a power of light, a product of light is a product of sRGB
            own = srgb_bytes(colors, self._is_linear)[faces]
            tint = (tint.astype(np.float32) * own / 255).round().astype(np.uint8)
        return np.ascontiguousarray(tint)

    def _attribute(self, primitive: Primitive, name: str, types: str, where: str) -> Float[np.ndarray, "n k"]:
        """Values of an attribute, one row for each vertex."""
        index, place = primitive.attributes[name], f"{where}.attributes.{name}"
        accessor = pick(self._header.accessors, index, "accessors", place)
        packed = extension(primitive, DRACO, DracoPrimitive, where)
        if packed is None or name not in packed.attributes:
            values = self._arrays.stored(index, types, place)
        else:
            values = self._unpacked(packed, where)[1].get(packed.attributes[name])
            if values is None:
                raise DamagedMeshError(f"is damaged: the Draco data of {where} has no attribute {name}")
        count = pick(self._header.accessors, primitive.attributes["POSITION"], "accessors", where).count
        if len(values) != count:
            raise DamagedMeshError(f"is damaged: {place} has {len(values)} rows for {count} vertices")
        return normalize(values, accessor.normalized or name.startswith(("COLOR", "WEIGHTS")))

    def _unpacked(self, packed: DracoPrimitive, where: str) -> tuple[np.ndarray, dict[int, np.ndarray]]:
        """Faces and attributes, by their number, of Draco data."""
        if packed.buffer_view not in self._decoded:
            draco = import_extra("DracoPy", "meshes", "a mesh with Draco compression")
            data = self._arrays.view(packed.buffer_view, where)
            try:
                mesh = draco.decode(data)
                faces = np.asarray(mesh.faces, np.int64).reshape(-1, 3)
                found = {entry["unique_id"]: np.asarray(entry["data"]) for entry in mesh.attributes}
            except Exception as error:  # whatever the decoder raises over foreign bytes
                raise DamagedMeshError(
                    f"has a part, {where}, whose Draco compression cannot be decoded: it is damaged"
                ) from error
            self._decoded[packed.buffer_view] = faces, found
        return self._decoded[packed.buffer_view]

    def _faces(self, primitive: Primitive, count: int, where: str) -> Int[np.ndarray, "f 3"]:
        """Corners of the triangles of a list, a strip or a fan."""
        packed = extension(primitive, DRACO, DracoPrimitive, where)
        if packed is not None:
            faces = self._unpacked(packed, where)[0]
        else:
            corners = np.arange(count)
            if primitive.indices is not None:
                stored = self._arrays.stored(primitive.indices, "SCALAR", f"{where}.indices")[:, 0]
                if stored.dtype.kind != "u":
                    raise DamagedMeshError(f"is damaged: {where}.indices are no unsigned integers")
                corners = stored.astype(np.int64)
            if primitive.mode == 4 and len(corners) % 3:
                raise DamagedMeshError(f"is damaged: {where} has {len(corners)} corners, no multiple of 3")
            faces = _TRIANGLES[primitive.mode](corners)
        if faces.size and not 0 <= faces.min() <= faces.max() < count:
            raise DamagedMeshError(f"is damaged: {where}.indices names vertex {faces.max()}, and there are {count}")
        return faces

    def _morphed(self, vertices: np.ndarray, weights: list[float], primitive: Primitive, where: str) -> np.ndarray:
        for number, (target, weight) in enumerate(zip(primitive.targets, weights, strict=False)):
            if weight and "POSITION" in target:
                shift = self._arrays.numbers(target["POSITION"], "VEC3", f"{where}.targets[{number}].POSITION")
                if len(shift) != len(vertices):
                    raise DamagedMeshError(
                        f"is damaged: {where}.targets[{number}] has {len(shift)} rows for {len(vertices)} vertices"
                    )
                vertices = vertices + weight * shift
        return vertices

    def _skinned(self, vertices: np.ndarray, index: int, primitive: Primitive, where: str) -> np.ndarray:
        """Vertices (n, 3) in the world, moved by the joints of a skin."""
        skin, place = pick(self._header.skins, index, "skins", where), f"skins[{index}]"
        for joint in skin.joints:
            pick(self._header.nodes, joint, "nodes", f"{place}.joints")
        poses = self._worlds[skin.joints]
        if skin.inverse_bind_matrices is not None:
            inverse = self._arrays.numbers(skin.inverse_bind_matrices, "MAT4", f"{place}.inverseBindMatrices")
            if len(inverse) < len(poses):
                raise DamagedMeshError(f"is damaged: {place} has {len(inverse)} matrices for {len(poses)} joints")
            poses = poses @ inverse[: len(poses)].reshape(-1, 4, 4).swapaxes(1, 2)
        moved, total = np.zeros_like(vertices), np.zeros(len(vertices))
        for number in range(len(primitive.attributes)):
            if f"JOINTS_{number}" not in primitive.attributes or f"WEIGHTS_{number}" not in primitive.attributes:
                break
            joints = self._attribute(primitive, f"JOINTS_{number}", "VEC4", where).astype(np.int64)
            weights = self._attribute(primitive, f"WEIGHTS_{number}", "VEC4", where)
            if joints.size and not 0 <= joints.min() <= joints.max() < len(poses):
                raise DamagedMeshError(f"is damaged: {where} names joint {joints.max()} of {len(poses)}")
            for joint, weight in zip(joints.T, weights.T, strict=True):
                pose = poses[joint]
                moved += weight[:, None] * (np.einsum("nij,nj->ni", pose[:, :3, :3], vertices) + pose[:, :3, 3])
                total += weight
        return moved / np.where(total > 0, total, 1)[:, None]

    def _paint(self, index: int | None) -> _Paint:
        """Base colour of a material; white without one."""
        if index not in self._paints:
            self._paints[index] = self._new_paint(index)
        return self._paints[index]

    def _new_paint(self, index: int | None) -> _Paint:
        if index is None:
            return _Paint(np.ones(3), None, False)
        where = f"materials[{index}]"
        material = pick(self._header.materials, index, "materials", "a primitive")
        usual = material.pbr_metallic_roughness or MetallicRoughness()
        older = extension(material, GLOSSINESS, SpecularGlossiness, where)
        info, factor = usual.base_color_texture, usual.base_color_factor
        if older is not None and info is None:
            info, factor = older.diffuse_texture, older.diffuse_factor
        if info is None:
            return _Paint(np.array(factor[:3]), None, False)
        transform = extension(info, TRANSFORM, TextureTransform, f"{where} (its texture)")
        chosen = info.tex_coord if transform is None or transform.tex_coord is None else transform.tex_coord
        picture = self._texture(info, where)
        return _Paint(np.array(factor[:3]), picture, picture is None, f"TEXCOORD_{chosen}", transform)

    def _texture(self, info: TextureInfo, where: str) -> Pixels | None:
        """The first picture of a texture that can be read; None, and a note, where none can."""
        texture = pick(self._header.textures, info.index, "textures", where)
        place = f"textures[{info.index}]"
        others = (extension(texture, name, OtherSource, place) for name in SOURCES)
        sources = [texture.source, *(other.source for other in others if other is not None)]
        failed: PictureError | None = None
        for source in (source for source in sources if source is not None):
            found = self._picture(source, place)
            if not isinstance(found, PictureError):
                return found
            failed = failed or found
        self._beside.note(str(failed or PictureError(place, "has no picture")))
        return None

    def _picture(self, index: int, where: str) -> Pixels | PictureError:
        """A picture, or why it cannot be had."""
        if index not in self._pictures:
            image, place = pick(self._header.images, index, "images", where), f"images[{index}]"
            try:
                if image.buffer_view is not None:
                    self._pictures[index] = decode_picture(self._arrays.view(image.buffer_view, place), place)
                elif image.uri is not None:
                    inside = decode_data_uri(image.uri, f"{place}.uri")
                    self._pictures[index] = (
                        self._beside.picture(image.uri) if inside is None else decode_picture(inside, place)
                    )
                else:
                    raise PictureError(place, "has neither a uri nor a bufferView")
            except PictureError as error:
                self._pictures[index] = error
        return self._pictures[index]


def _is_skinned(node: Node, primitive: Primitive) -> bool:
    return node.skin is not None and "JOINTS_0" in primitive.attributes


def _strip(corners: np.ndarray) -> np.ndarray:
    """Triangles of a strip: every second is turned, so that all face one way."""
    faces = np.stack([corners[:-2], corners[1:-1], corners[2:]], 1)
    faces[1::2] = faces[1::2, [0, 2, 1]]
    return faces


_TRIANGLES = {
    4: lambda corners: corners.reshape(-1, 3),
    5: _strip,
    6: lambda corners: np.stack([np.full(max(0, len(corners) - 2), corners[0]), corners[1:-1], corners[2:]], 1),
}
"""Triangles (f, 3) of corners (n), by mode."""


def _matrix_of(node: Node) -> Float[np.ndarray, "4 4"]:
    """Pose of a node relative to its parent; the file's matrices are column-major."""
    if node.matrix is not None:
        return np.array(node.matrix, float).reshape(4, 4).T
    return _compose(*(np.array([row], float) for row in (node.translation, node.rotation, node.scale)))[0]


def _compose(
    translation: Float[np.ndarray, "n 3"], rotation: Float[np.ndarray, "n 4"], scale: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "n 4 4"]:
    """T R S of translations, quaternions (x, y, z, w) and scales."""
    length = np.linalg.norm(rotation, axis=1, keepdims=True)
    x, y, z, w = (rotation / np.where(length > 0, length, 1)).T
    turned = np.array([
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ])  # fmt: skip
    poses = np.tile(np.eye(4), (len(translation), 1, 1))
    poses[:, :3, :3] = turned.transpose(2, 0, 1) * scale[:, None]
    poses[:, :3, 3] = translation
    return poses


def _transformed(uv: Float[np.ndarray, "n 2"], how: TextureTransform) -> Float[np.ndarray, "n 2"]:
    """Texture coordinates scaled, turned and moved."""
    cos, sin = math.cos(how.rotation), math.sin(how.rotation)
    return uv * how.scale @ np.array([[cos, -sin], [sin, cos]]) + how.offset
