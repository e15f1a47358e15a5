"""Solids and sheets: divide a mesh into pieces with an inside that a body can be in, and mere surfaces.

Vertices at one place are joined first: files hold one for each texture coordinate and normal. Pieces are faces
connected over edges that exactly two of them share: within each part first, then, for what is open, over all parts.

    closed, faces outwards          a solid
    closed, faces inwards           a room if it is large or holds other pieces, else a solid inside out
    open, but mostly around itself  a solid, by its winding number (a block without a bottom)
    everything else                 a sheet: walls without thickness, ground, the shell of a room
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy
import trimesh
from jaxtyping import Float, Int

from nerfnav.importers.meshes.parts import Parts
from nerfnav.world import Solid, winding_number

_SAME = 1e-6
"""Vertices closer than this share of the longest edge are one."""
_LARGE = 0.5
"""A piece as large as this share of the whole, along every axis, may be the shell of a room."""
_HELD = 0.5
"""And is one if it holds this share of the rest."""
_ASKED = 200
"""Faces of the rest that are asked for that."""
_PROBES = 64
"""Faces of an open piece that are asked for its winding number."""
_MOSTLY_CLOSED = 0.7
"""Mean winding number just below the faces of an open piece that still has an inside; 0.5 for flat ground."""
_DEPTH = 0.05
"""Depth of the samples below the faces, in longest edges of the piece."""
_MOST_OPEN_FACES = 20_000
"""Larger open pieces are sheets: winding numbers cost as much as a piece has faces."""
_FLAT = 1e-6
"""A closed piece whose volume is below this share of its area^1.5 has no inside: a face seen from both sides."""


@dataclass(frozen=True, eq=False)
class Pieces:
    """Solids and sheets of a mesh."""

    solids: tuple[trimesh.Trimesh, ...]
    """Pieces with an inside, faces outwards."""
    sheets: tuple[trimesh.Trimesh, ...]
    """The rest, as one mesh or none."""
    open_solids: int
    """Number of solids that are not watertight."""


def split_solids(parts: Parts) -> Pieces:
    """Divide a mesh in the world [m] into solids and sheets."""
    where = _places(parts)
    rest = np.ones(len(parts.faces), bool)
    closed = []
    for together in (where * (parts.part.max() + 1) + parts.part[:, None], where):
        for piece in _connected(together, np.flatnonzero(rest)):
            if piece.is_closed:
                closed.append(piece.faces)
                rest[piece.faces] = False
    # one vertex for each place, so that these are faces; what has lost its area in joining stays, as it is harmless
    vertices = np.zeros((where.max() + 1, 3))
    vertices[where] = parts.vertices[parts.faces]
    extent = np.ptp(vertices, axis=0)
    solids, sheets, leaky = [], [], 0
    for index in closed:
        mesh = _mesh(vertices, where[index])
        solid = _closed_solid(mesh, extent, lambda index=index: _centers(vertices, where, index))
        (sheets if solid is None else solids).append(index if solid is None else solid)
    for piece in _connected(where, np.flatnonzero(rest)):
        solid = _open_solid(_mesh(vertices, where[piece.faces]))
        leaky += solid is not None
        (sheets if solid is None else solids).append(piece.faces if solid is None else solid)
    surface = (_mesh(vertices, where[np.concatenate(sheets)]),) if sheets else ()
    return Pieces(tuple(solids), surface, leaky)


@dataclass(frozen=True)
class _Piece:
    faces: np.ndarray
    is_closed: bool


def _places(parts: Parts) -> Int[np.ndarray, "f 3"]:
    """A number for each corner of each face: the same for corners at the same place."""
    edge = _SAME * float(np.ptp(parts.bounds, axis=0).max())
    rounded = np.round((parts.vertices - parts.bounds[0]) / edge).astype(np.int64)
    _, number = trimesh.grouping.unique_rows(rounded)
    return number[parts.faces]


def _connected(corners: Int[np.ndarray, "f 3"], among: Int[np.ndarray, " k"]) -> list[_Piece]:
    """Pieces of the faces `among`, connected over edges that two of them share; closed where all edges are such."""
    if len(among) == 0:
        return []
    asked = corners[among]
    edges = np.sort(np.stack([asked, np.roll(asked, -1, axis=1)], -1), -1).reshape(-1, 2)
    _, edge = np.unique(edges[:, 0] * (edges.max() + 1) + edges[:, 1], return_inverse=True)
    shared_by_two = np.bincount(edge)[edge] == 2
    order = np.argsort(edge, kind="stable")
    pairs = (order[shared_by_two[order]] // 3).reshape(-1, 2)
    links = scipy.sparse.coo_matrix((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), (len(among), len(among)))
    count, label = scipy.sparse.csgraph.connected_components(links, directed=False)
    closed = np.ones(count, bool)
    np.logical_and.at(closed, label, shared_by_two.reshape(-1, 3).all(1))
    by_label = np.split(among[np.argsort(label, kind="stable")], np.cumsum(np.bincount(label))[:-1])
    return [_Piece(faces, bool(is_closed)) for faces, is_closed in zip(by_label, closed, strict=True)]


def _mesh(vertices: Float[np.ndarray, "v 3"], faces: Int[np.ndarray, "f 3"]) -> trimesh.Trimesh:
    used, renumbered = np.unique(faces, return_inverse=True)
    return trimesh.Trimesh(vertices[used], renumbered.reshape(-1, 3), process=False)


def _centers(vertices: np.ndarray, faces: np.ndarray, without: np.ndarray) -> Float[np.ndarray, "n 3"]:
    """Middles of some faces that do not belong to a piece."""
    others = np.setdiff1d(np.arange(len(faces)), without, assume_unique=True)
    some = others[:: max(1, len(others) // _ASKED)]
    return vertices[faces[some]].mean(1)


def _closed_solid(
    mesh: trimesh.Trimesh, extent: np.ndarray, others: Callable[[], np.ndarray]
) -> trimesh.Trimesh | None:
    """A watertight piece with its faces outwards; None for the shell of a room, and for what has no volume."""
    if not mesh.is_winding_consistent:
        trimesh.repair.fix_winding(mesh)
    if abs(mesh.volume) <= _FLAT * mesh.area**1.5:
        return None
    inwards = mesh.volume < 0
    if inwards:
        mesh.invert()
    if (mesh.extents >= _LARGE * extent).all():
        middles = others()
        if inwards and len(middles) == 0:
            return None
        if len(middles) and Solid(mesh).contains(middles).mean() >= _HELD:
            return None
    return mesh


def _open_solid(mesh: trimesh.Trimesh) -> trimesh.Trimesh | None:
    """Open piece with its faces outwards whose winding number separates inside from outside; None where it does not."""
    if len(mesh.faces) < 4 or len(mesh.faces) > _MOST_OPEN_FACES or not mesh.is_winding_consistent:
        return None
    depth = _DEPTH * mesh.extents.max()
    middles, normals = mesh.triangles_center, mesh.face_normals
    step = max(1, len(middles) // _PROBES)
    below, above = (
        float(winding_number(mesh.triangles, middles[::step] + way * depth * normals[::step]).mean())
        for way in (-1, 1)
    )
    if below >= _MOSTLY_CLOSED:
        return mesh
    if above <= -_MOSTLY_CLOSED:
        mesh.invert()
        return mesh
    return None
