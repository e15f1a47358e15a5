"""Parts of a mesh file, joined to one mesh, with the paint of each.

Textures are decoded once and shared by parts, never copied. Plain colours are sRGB at the corners of faces: the
colour of the material times those of faces or vertices.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int, Shaped, UInt8

from nerfnav.geometry import to_srgb
from nerfnav.importers.core.errors import MeshFileError
from nerfnav.world import Paint
from nerfnav.world.surface import Image as Pixels


class DamagedMeshError(MeshFileError):
    """A mesh file that is not whole: the message goes on from the name of the file."""


LARGEST = 1e30
"""Coordinates beyond it have no products in double precision."""
GREY = 178
"""sRGB brightness of what has no colour at all."""


@dataclass(frozen=True, eq=False)
class Part:
    """A part of a mesh file: f faces of one material."""

    vertices: Float[np.ndarray, "v 3"]
    """Points, in the file's own axes and unit."""
    faces: Int[np.ndarray, "f 3"]
    """Indices into the vertices, counter-clockwise seen from outside."""
    tint: UInt8[np.ndarray, "f 3 3"]
    """sRGB colour at each face's corners, which multiplies the picture."""
    uv: Float[np.ndarray, "f 3 2"] | None = None
    """Texture coordinates of each face's corners; v points up."""
    picture: Pixels | None = None
    """Texture: parts that share one hold the same array."""
    name: str = ""
    """Name in the file; empty where it has none."""

    def moved_by(self, transform: Float[np.ndarray, "4 4"]) -> "Part":
        """The part in another place; a mirror, which turns faces inside out, turns them back."""
        moved = replace(self, vertices=self.vertices @ transform[:3, :3].T + transform[:3, 3])
        if np.linalg.det(transform[:3, :3]) >= 0:
            return moved
        uv = None if self.uv is None else self.uv[:, ::-1]
        return replace(moved, faces=self.faces[:, ::-1], tint=self.tint[:, ::-1], uv=uv)


def srgb_bytes(colors: Shaped[np.ndarray, "n c"], linear: bool) -> UInt8[np.ndarray, "n 3"]:
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
    names: tuple[str, ...]
    """Names of the parts; empty where the file gives none."""

    @property
    def bounds(self) -> Float[np.ndarray, "2 3"]:
        """Lowest and highest coordinates of all faces."""
        return np.array([self.vertices.min(0), self.vertices.max(0)])

    @property
    def areas(self) -> Float[np.ndarray, " f"]:
        """Area of each face."""
        sides = np.diff(self.vertices[self.faces], axis=1)
        return np.linalg.norm(np.cross(sides[:, 0], sides[:, 1]), axis=-1) / 2

    def select(self, chosen: Bool[np.ndarray, " f"]) -> "Parts":
        """Some of the faces, and the vertices that they have."""
        used, faces = np.unique(self.faces[chosen], return_inverse=True)
        paint = replace(
            self.paint,
            image_of_face=self.paint.image_of_face[chosen],
            uv=self.paint.uv[chosen],
            tint=self.paint.tint[chosen],
        )
        return Parts(
            self.vertices[used], faces.reshape(-1, 3), self.part[chosen], paint, self.plain[chosen], self.names
        )


def join_parts(parts: Sequence[Part], path: Path) -> Parts:
    """Join what a file holds. Raises MeshFileError for vertices that are no numbers and for no face of any area."""
    pictures: dict[int, int] = {}
    images: list[Pixels] = []
    pieces, names, corners = [], [], 0
    for number, part in enumerate(part for part in parts if len(part.faces)):
        image = -1
        if part.picture is not None and part.uv is not None:
            image = pictures.setdefault(id(part.picture), len(images))
            if image == len(images):
                images.append(part.picture)
        pieces.append(_piece(part, path, image, number, corners))
        corners += len(pieces[-1][0])
        names.append(part.name)
    vertices, faces, part, image, uv, tint, plain = (np.concatenate(arrays) for arrays in zip(*pieces, strict=True))
    joined = Parts(vertices, faces, part, Paint(tuple(images), image, uv, tint), plain, tuple(names))
    kept = joined.areas > 0
    if not kept.any():
        raise MeshFileError(f"{path} has no face with any area: there is nothing to see or to touch")
    return joined if kept.all() else joined.select(kept)


def _piece(part: Part, path: Path, image: int, number: int, first: int) -> tuple[np.ndarray, ...]:
    """Vertices, faces, part, image, uv, tint and plainness of part `number`, whose first vertex is `first`."""
    if part.faces.max() >= len(part.vertices) or part.faces.min() < 0:
        raise MeshFileError(f"{path} has a face with a corner that does not exist: it is damaged")
    used, faces = np.unique(part.faces, return_inverse=True)
    vertices, count = np.asarray(part.vertices, float)[used], len(part.faces)
    wrong = int((~(np.abs(vertices) < LARGEST)).any(1).sum())
    if wrong:
        raise MeshFileError(f"{path} has {wrong} vertices with coordinates that are no finite numbers")
    uv = np.zeros((count, 3, 2), np.float32)
    if image >= 0:
        # single precision: whole turns are left out first, or what repeats far from 0 would lose its place
        exact = np.nan_to_num(np.asarray(part.uv, float), posinf=0, neginf=0)
        uv = (exact - np.floor(exact.min((0, 1)))).astype(np.float32)
    plain = image < 0 and bool((part.tint == part.tint[0, 0]).all())
    return (
        vertices,
        faces.reshape(-1, 3) + first,
        np.full(count, number),
        np.full(count, image, np.int32),
        uv,
        part.tint,
        np.full(count, plain),
    )
