"""Texture atlas of a mesh: charts of connected triangles that face alike, flattened along an axis, side by side.

Each triangle is seen from the axis, of six, that it faces most, which stretches no area by more than a factor of
sqrt(3); where that leaves specks, neighbours decide. Charts are packed on shelves, the tallest first.
"""

import math
from dataclasses import dataclass

import numpy as np
import scipy
from jaxtyping import Bool, Float, Int

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.jit import kernel

MARGIN = 2
"""Texels around each chart that show what is nearest to it, so that lookups between texels find no other chart."""
LARGEST = 4096
"""Texels along an edge that every WebGL 2 is sure to have."""
_TAKEN_APART = 3
"""Number of times that charts that overlap themselves are split."""
_STEEPEST = 0.3
"""Least cosine between a triangle's normal and the axis it is seen from."""
_VOTES, _ROUNDS = 0.5, 8
"""Weight of each neighbour's axis, as a cosine, and number of rounds."""
_COARSER = 1.2

Vertices = Float[np.ndarray, "n 3"]
Faces = Int[np.ndarray, "m 3"]


@dataclass(frozen=True)
class Atlas:
    """Placement of the triangles of a mesh in a picture."""

    vertices: Int[np.ndarray, " k"]
    """The mesh's vertex of each corner; vertices on the border of charts have a corner in each."""
    faces: Int[np.ndarray, "m 3"]
    """Corners of each triangle, in the mesh's order."""
    texels: Float[np.ndarray, "k 2"]
    """x, y of each corner; the middle of texel [row, column] is at (column, row)."""
    size: tuple[int, int]
    """Height and width [texels]."""
    face_at: Int[np.ndarray, " t"]
    """Row by row, the triangle that each texel shows, -1 for none."""
    weights: Float[np.ndarray, "t 3"]
    """Barycentric weights of each texel's middle there; negative where it lies beside the triangle."""

    def shown(self, values: Float[np.ndarray, "n c"], texels: Int[np.ndarray, " s"]) -> Float[np.ndarray, "s c"]:
        """Interpolate values of the mesh's vertices at texels that show something."""
        corners = self.vertices[self.faces[self.face_at[texels]]]
        return (values[corners] * self.weights[texels][..., None]).sum(1)


def atlas_of(vertices: Vertices, faces: Faces, texel: float, most: int) -> Atlas:
    """The atlas of a mesh with texels of `texel` [m], or larger ones where there would be more than `most`.

    Raises InvalidInputError for a mesh without triangles.
    """
    if len(faces) == 0:
        raise InvalidInputError("an atlas is of a mesh with triangles: this one has none")
    kind = _kinds(vertices, faces)
    atlas, texel, covered = _laid_out(vertices, faces, kind, texel, most)
    for _ in range(_TAKEN_APART):
        if not covered.any():
            break
        kind = np.where(covered, kind + 6, kind)  # of another kind: into another chart
        atlas, texel, covered = _laid_out(vertices, faces, kind, texel, most)
    return atlas


def _laid_out(
    vertices: Vertices, faces: Faces, kind: Int[np.ndarray, " m"], texel: float, most: int
) -> tuple[Atlas, float, Bool[np.ndarray, " m"]]:
    """The atlas whose charts are of connected triangles of one kind, the size of its texels [m], and which triangles
    others cover there."""
    across, chart_of_face = _charts(faces, kind)
    key = chart_of_face[:, None].astype(np.int64) * len(vertices) + faces
    corners, flat = np.unique(key, return_inverse=True)
    vertex, chart = corners % len(vertices), corners // len(vertices)
    flattened = np.take_along_axis(vertices[vertex], across[chart], 1)
    low, high = (np.full((len(across), 2), sign * np.inf) for sign in (1, -1))
    np.minimum.at(low, chart, flattened)
    np.maximum.at(high, chart, flattened)
    while True:
        sizes = np.ceil((high - low) / texel).astype(np.int64) + 1 + 2 * MARGIN
        places, size = _packed(sizes)
        if size[0] * size[1] <= most and max(size) <= LARGEST:
            break
        texel *= _COARSER
    texels = ((flattened - low[chart]) / texel + MARGIN + places[chart]).astype(np.float32)
    flat = flat.reshape(-1, 3)
    nearest, face_at = np.full(size, -np.inf, np.float32), np.full(size, -1, np.int32)
    weights = np.zeros((*size, 3), np.float32)
    along = np.take_along_axis(vertices[faces].mean(1), (kind % 3)[:, None], 1)[:, 0]
    heights = np.where(kind % 6 < 3, along, -along).astype(np.float32)
    covered = np.zeros(len(faces), bool)
    rasterize(texels[flat], heights, nearest, face_at, weights, covered)
    return Atlas(vertex, flat, texels, size, face_at.reshape(-1), weights.reshape(-1, 3)), texel, covered


def _charts(faces: Faces, kind: Int[np.ndarray, " m"]) -> tuple[Int[np.ndarray, "c 2"], Int[np.ndarray, " m"]]:
    """The two axes that each chart is spread along, and the chart of each triangle."""
    pairs = _neighbours(faces)
    joined = pairs[kind[pairs[:, 0]] == kind[pairs[:, 1]]]
    graph = scipy.sparse.coo_matrix((np.ones(len(joined), bool), joined.T), shape=(len(faces), len(faces)))
    count, chart = scipy.sparse.csgraph.connected_components(graph, directed=False)
    axis = np.zeros(count, np.int64)
    axis[chart] = kind % 3
    return np.array([(1, 2), (0, 2), (0, 1)])[axis], chart


def _kinds(vertices: Vertices, faces: Faces) -> Int[np.ndarray, " m"]:
    """From where each triangle is seen: 0 to 2 are +x, +y, +z, and 3 to 5 -x, -y, -z."""
    corners, pairs = vertices[faces], _neighbours(faces)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    cosines = np.concatenate([normals, -normals], 1)
    side = cosines.argmax(1)
    allowed = (cosines >= _STEEPEST) | (np.arange(6) == side[:, None])  # a triangle without area has no cosine
    for _ in range(_ROUNDS):
        votes = np.bincount(6 * pairs[:, 0] + side[pairs[:, 1]], minlength=6 * len(side))
        votes += np.bincount(6 * pairs[:, 1] + side[pairs[:, 0]], minlength=6 * len(side))
        side = np.where(allowed, cosines + _VOTES * votes.reshape(-1, 6), -np.inf).argmax(1)
    return side


def _neighbours(faces: Faces) -> Int[np.ndarray, "p 2"]:
    """Pairs of triangles that share an edge."""
    edges = np.sort(faces[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1).astype(np.int64)
    key = edges[:, 0] * (int(faces.max()) + 1) + edges[:, 1]
    order = np.argsort(key, kind="stable")
    same = np.flatnonzero(key[order[1:]] == key[order[:-1]])
    return np.stack([order[same] // 3, order[same + 1] // 3], 1)


def _packed(sizes: Int[np.ndarray, "c 2"]) -> tuple[Int[np.ndarray, "c 2"], tuple[int, int]]:
    """x, y of each chart's first texel, and height and width of what holds them all."""
    width = max(int(sizes[:, 0].max()), math.ceil(math.sqrt(1.05 * float((sizes[:, 0] * sizes[:, 1]).sum()))))
    places = np.zeros_like(sizes)
    x = y = shelf = 0
    for chart in np.argsort(-sizes[:, 1], kind="stable").tolist():
        wide, tall = sizes[chart].tolist()
        if x + wide > width:
            x, y, shelf = 0, y + shelf, 0
        places[chart] = x, y
        x, shelf = x + wide, max(shelf, tall)
    return places, (y + shelf, width)


REACH = np.float32(1.42)
"""Texels around triangles are theirs too, so far from their edges: bilinear lookups inside need no others."""


_SHARED = np.float32(0.05)
"""Texels within which a texel lies on the edge that two triangles share."""


@kernel()
def rasterize(corners, heights, nearest, face_at, weights, covered):
    """Write which triangle each texel shows, and the barycentric weights of its middle there.

    `corners` (m, 3, 2) are x, y in texels, the middle of texel [y, x] at (x, y). Of two triangles around a texel, the
    one of larger `heights` (m) is shown, as a floor under a slide may be in the chart of both. `nearest` (h, w), -inf
    at first, is how deep inside its triangle a texel is, below 0 outside; `face_at` (h, w), -1 at first; `weights`
    (h, w, 3), with negative ones outside. `covered` (m) is set for triangles of which another one hides a texel.
    """
    height, width = nearest.shape
    for face in range(corners.shape[0]):
        ax, ay = corners[face, 0, 0], corners[face, 0, 1]
        bx, by = corners[face, 1, 0], corners[face, 1, 1]
        cx, cy = corners[face, 2, 0], corners[face, 2, 1]
        area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
        if area == 0.0:
            continue
        # weights times heights of the triangle are distances from its edges
        opposite_a = abs(area) / math.sqrt((cx - bx) ** 2 + (cy - by) ** 2)
        opposite_b = abs(area) / math.sqrt((cx - ax) ** 2 + (cy - ay) ** 2)
        opposite_c = abs(area) / math.sqrt((bx - ax) ** 2 + (by - ay) ** 2)
        left, right = max(0, math.ceil(min(ax, bx, cx) - REACH)), min(width - 1, int(max(ax, bx, cx) + REACH))
        top, bottom = max(0, math.ceil(min(ay, by, cy) - REACH)), min(height - 1, int(max(ay, by, cy) + REACH))
        for y in range(top, bottom + 1):
            for x in range(left, right + 1):
                b = ((x - ax) * (cy - ay) - (y - ay) * (cx - ax)) / area
                c = ((bx - ax) * (y - ay) - (by - ay) * (x - ax)) / area
                a = np.float32(1.0) - b - c
                inside = min(a * opposite_a, b * opposite_b, c * opposite_c)
                if inside < -REACH:
                    continue
                if min(inside, nearest[y, x]) > _SHARED:
                    shown = face_at[y, x]
                    above = heights[face] > heights[shown]
                    covered[shown if above else face] = True
                else:
                    above = inside > nearest[y, x]
                if above:
                    nearest[y, x], face_at[y, x] = inside, face
                    weights[y, x, 0], weights[y, x, 1], weights[y, x, 2] = a, b, c
