"""Parts of a mesh file, joined to one mesh, with the paint of each.

Textures are decoded once and shared by parts, never copied. Plain colours are sRGB at the corners of faces: the
colour of the material times those of faces or vertices.
"""

from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Bool, Float, Float32, Int, Shaped, UInt8
from PIL.Image import Image
from trimesh.visual.color import ColorVisuals
from trimesh.visual.material import SimpleMaterial
from trimesh.visual.texture import TextureVisuals

from nerfnav.geometry import to_srgb
from nerfnav.importers.core.errors import MeshFileError, first_line
from nerfnav.importers.meshes.files import MeshFile
from nerfnav.importers.meshes.gltf_extensions import NO_TEXTURE
from nerfnav.world import Paint
from nerfnav.world.surface import Image as Pixels


class Palette:
    """Images by the object that holds them, so that parts of one texture share one array."""

    def __init__(self, file: MeshFile) -> None:
        self._file = file
        self._index: dict[int, int] = {}
        self.images: list[Pixels] = []

    def index_of(self, image: Image) -> int:
        """Index of an image among all, each decoded once."""
        if id(image) not in self._index:
            try:
                pixels = np.asarray(image.convert("RGB"), np.uint8)
            except Exception as error:  # whatever a picture of unknown origin makes its reader raise
                raise MeshFileError(
                    f"{self._file.path} has a texture that cannot be decoded: {first_line(error)}"
                ) from error
            self._index[id(image)] = len(self.images)
            self.images.append(pixels)
        return self._index[id(image)]


GREY = 178
"""sRGB brightness of what has no colour at all."""


def tint_of(mesh: trimesh.Trimesh, faces: Int[np.ndarray, "f 3"], linear: bool) -> UInt8[np.ndarray, "f 3 3"]:
    """sRGB at each face's corners: the material's colour times those of faces or vertices."""
    visual, count = mesh.visual, len(faces)
    if not isinstance(visual, TextureVisuals):
        assert isinstance(visual, ColorVisuals)  # trimesh knows no third kind
        if visual.kind == "face":
            return np.repeat(_bytes(visual.face_colors, False)[:, None], 3, 1)
        if visual.kind == "vertex":
            return _bytes(visual.vertex_colors, linear)[faces]
        return np.full((count, 3, 3), GREY, np.uint8)
    tint = np.broadcast_to(_factor(visual.material, linear), (count, 3, 3))
    colors = visual.vertex_attributes.get("color")
    if colors is not None and len(colors) == len(mesh.vertices):
        # as sRGB is nearly a power of light, a product of light is a product of sRGB
        tint = (tint.astype(np.float32) * _bytes(colors, linear)[faces] / 255).round().astype(np.uint8)
    return np.ascontiguousarray(tint)


def _factor(material: object, linear: bool) -> UInt8[np.ndarray, " 3"]:
    """Colour factor of a material's image; its colour where it has no image."""
    factor = getattr(material, "baseColorFactor", None)
    if factor is None and getattr(material, "image", None) is None and isinstance(material, SimpleMaterial):
        factor = material.diffuse
    if factor is None:
        return np.full(3, 255, np.uint8)
    return _bytes(np.asarray(factor)[None], linear)[0]


def _bytes(colors: Shaped[np.ndarray, "n c"], linear: bool) -> UInt8[np.ndarray, "n 3"]:
    """Colours of any type as sRGB bytes: integers fill their range, other numbers lie in [0, 1]."""
    colors = np.asarray(colors)[:, :3]
    largest = np.iinfo(colors.dtype).max if np.issubdtype(colors.dtype, np.integer) else 1
    share = np.clip(np.nan_to_num(colors.astype(float)) / largest, 0, 1)
    return (255 * (to_srgb(share) if linear else share)).round().astype(np.uint8)


@dataclass(frozen=True, eq=False)
class Parts:
    """A mesh of f faces, joined from its parts, in the file's own axes and unit."""

    vertices: Float[np.ndarray, "v 3"]
    """Corners of faces, in double precision."""
    faces: Int[np.ndarray, "f 3"]
    """Indices into the vertices; parts share none."""
    part: Int[np.ndarray, " f"]
    """Number of the part of each face."""
    paint: Paint
    """Their colours."""
    plain: Bool[np.ndarray, " f"]
    """Faces of one colour all over their part: without light, none of their edges would be seen."""

    @property
    def bounds(self) -> Float[np.ndarray, "2 3"]:
        """Lowest and highest coordinates of all faces."""
        return np.array([self.vertices.min(0), self.vertices.max(0)])


def join_parts(file: MeshFile) -> Parts:
    """Join what a file holds. Raises MeshFileError for vertices that are no numbers and for no face of any area."""
    palette = Palette(file)
    pieces, corners = [], 0
    for number, node in enumerate(file.content.graph.nodes_geometry):
        transform, name = file.content.graph[node]
        mesh = file.content.geometry[name]
        if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces):
            pieces.append(_piece(mesh, np.asarray(transform, float), palette, file, number, corners))
            corners += len(mesh.vertices)
    vertices, faces, part, image, uv, tint, plain = (np.concatenate(arrays) for arrays in zip(*pieces, strict=True))
    kept = np.linalg.norm(np.cross(*(np.diff(vertices[faces], axis=1).swapaxes(0, 1))), axis=-1) > 0  # of some area
    if not kept.any():
        raise MeshFileError(f"{file.path} has no face with any area: there is nothing to see or to touch")
    paint = Paint(tuple(palette.images), image[kept], uv[kept], tint[kept])
    return Parts(vertices, faces[kept], part[kept], paint, plain[kept])


def _piece(
    mesh: trimesh.Trimesh,
    transform: Float[np.ndarray, "4 4"],
    palette: Palette,
    file: MeshFile,
    number: int,
    first: int,
) -> tuple[np.ndarray, ...]:
    """Vertices, faces, part, image, uv, tint and plainness of part `number`, whose first vertex is `first`."""
    wrong = int((~np.isfinite(mesh.vertices)).any(1).sum())
    if wrong or not np.isfinite(transform).all():
        raise MeshFileError(f"{file.path} has {wrong} vertices with coordinates that are no finite numbers")
    vertices = np.asarray(mesh.vertices, float) @ transform[:3, :3].T + transform[:3, 3]
    faces = np.asarray(mesh.faces, np.int64)
    if faces.max() >= len(vertices) or faces.min() < 0:
        raise MeshFileError(f"{file.path} has a face with a corner that does not exist: it is damaged")
    if np.linalg.det(transform[:3, :3]) < 0:  # a mirror turns faces inside out
        faces = faces[:, ::-1]
    count, visual = len(faces), mesh.visual
    uv = _uv(visual, len(vertices))
    material = getattr(visual, "material", None)
    picture = None if uv is None else getattr(material, "baseColorTexture", None) or getattr(material, "image", None)
    image = -1 if picture is None else palette.index_of(picture)
    tint = tint_of(mesh, faces, file.declared.linear)
    if image >= 0 and (palette.images[image] == NO_TEXTURE).all():  # a stand-in for none
        image, tint = -1, np.full_like(tint, GREY)
    plain = image < 0 and bool((tint == tint[0, 0]).all())
    return (
        vertices,
        faces + first,
        np.full(count, number),
        np.full(count, image, np.int32),
        np.zeros((count, 3, 2), np.float32) if uv is None else uv[faces],
        tint,
        np.full(count, plain),
    )


def _uv(visual: object, count: int) -> Float32[np.ndarray, "v 2"] | None:
    uv = getattr(visual, "uv", None)
    if uv is None or len(uv) != count:
        return None
    # single precision: whole turns are left out first, or what repeats far from 0 would lose its place
    uv = np.nan_to_num(np.asarray(uv, float)[:, :2], posinf=0, neginf=0)
    return (uv - np.floor(uv.min(0))).astype(np.float32)
