"""All parts of a mesh file as one mesh, with the paint of each: textures are shared, never copied from part to part."""

from dataclasses import dataclass

import numpy as np
import trimesh
from jaxtyping import Bool, Float, Float32, Int
from PIL.Image import Image

from nerfnav.importers.meshes.files import MeshFile
from nerfnav.importers.meshes.gltf_extensions import NO_TEXTURE
from nerfnav.importers.meshes.palette import Palette
from nerfnav.importers.meshes.refusal import MeshFileError
from nerfnav.importers.meshes.tints import GREY, tint_of
from nerfnav.world import Paint


@dataclass(frozen=True, eq=False)
class Parts:
    """A mesh of f faces, joined from its parts, in the file's own axes and unit."""

    vertices: Float[np.ndarray, "v 3"]
    """Corners of faces, in double precision."""
    faces: Int[np.ndarray, "f 3"]
    """Indices into the vertices; parts share none."""
    part: Int[np.ndarray, " f"]
    """Which part each face belongs to."""
    paint: Paint
    """Their colours."""
    plain: Bool[np.ndarray, " f"]
    """Faces of one colour all over their part: without light, none of their edges would be seen."""

    @property
    def bounds(self) -> Float[np.ndarray, "2 3"]:
        """Lowest and highest coordinates of all faces."""
        return np.array([self.vertices.min(0), self.vertices.max(0)])


def parts_of(file: MeshFile) -> Parts:
    """Join what a file holds. Raises MeshFileError for vertices that are no numbers and for no face of any area."""
    palette = Palette(file)
    pieces, corners = [], 0
    for number, node in enumerate(file.content.graph.nodes_geometry):
        transform, name = file.content.graph[node]
        mesh = file.content.geometry[name]
        if isinstance(mesh, trimesh.Trimesh) and len(mesh.faces):
            pieces.append(_piece(mesh, np.asarray(transform, float), palette, file, (number, corners)))
            corners += len(mesh.vertices)
    vertices, faces, part, image, uv, tint, plain = (np.concatenate(arrays) for arrays in zip(*pieces, strict=True))
    area = np.linalg.norm(np.cross(*(np.diff(vertices[faces], axis=1).swapaxes(0, 1))), axis=-1)
    kept = area > 0
    if not kept.any():
        raise MeshFileError(f"{file.path} has no face with any area: there is nothing to see or to touch")
    paint = Paint(tuple(palette.images), image[kept], uv[kept], tint[kept])
    return Parts(vertices, faces[kept], part[kept], paint, plain[kept])


def _piece(
    mesh: trimesh.Trimesh,
    transform: Float[np.ndarray, "4 4"],
    palette: Palette,
    file: MeshFile,
    first: tuple[int, int],
) -> tuple[np.ndarray, ...]:
    """Vertices, faces, part, image, uv, tint and plainness of one part, whose number and first vertex are `first`."""
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
    picture = None if uv is None else _image(visual)
    image = -1 if picture is None else palette.index_of(picture)
    tint = tint_of(mesh, faces, file.declared.linear)
    if image >= 0 and (palette.images[image] == NO_TEXTURE).all():  # a stand-in for none
        image, tint = -1, np.full_like(tint, GREY)
    plain = image < 0 and bool((tint == tint[0, 0]).all())
    return (
        vertices,
        faces + first[1],
        np.full(count, first[0]),
        np.full(count, image, np.int32),
        np.zeros((count, 3, 2), np.float32) if uv is None else uv[faces],
        tint,
        np.full(count, plain),
    )


def _image(visual: object) -> Image | None:
    """The picture of a part's base colour; None where it has none."""
    material = getattr(visual, "material", None)
    base = getattr(material, "baseColorTexture", None)
    return base if base is not None else getattr(material, "image", None)


def _uv(visual: object, count: int) -> Float32[np.ndarray, "v 2"] | None:
    uv = getattr(visual, "uv", None)
    if uv is None or len(uv) != count:
        return None
    # single precision: whole turns are left out first, or what repeats far from 0 would lose its place
    uv = np.nan_to_num(np.asarray(uv, float)[:, :2], posinf=0, neginf=0)
    return (uv - np.floor(uv.min(0))).astype(np.float32)
