"""Points of a body: where densities are taken, on its surface and inside it.

A compact body is filled as a grid would. Of one with parts thinner than the spacing, each part has points as close as
its own thickness asks: on all of its surface, and inside in layers below that, down to its middle.
"""

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy
from jaxtyping import Bool, Float

from nerfnav.core.errors import InvalidInputError
from nerfnav.robots.surface import divide_until, longest_edges

if TYPE_CHECKING:
    import trimesh

MOST_POINTS = 5000
"""Body points from which on planning takes seconds."""
THINNEST = 0.001
"""Thickness of a part [m] below which its mesh is a mistake, or in other units."""
FINEST, FOURTH = 0.01, 0.25
"""Smallest distance [m] between points that a thin part asks for, a little less than the voxels of fields, and that
distance as a share of its thickness."""
MANY = 1500
"""Points to which thin parts bring a body; they are further apart where there would be more."""
_PLACES, _CANDIDATES = 1000, 15_000
"""Largest number of places that tell the thinnest part, and about as many that points are chosen from."""
_OPPOSITE, _TAPERED = -0.99, -0.8
"""Cosine between the normals of the two sides of a plate, and of an arm that tapers; a wedge, whose edge is thin but
which is none, has a larger one."""
_LONGEST_PUSH = 3**0.5
"""Largest way of a point in a metre of growth [m]: that of a box's corner."""
_ONE_PLANE = 1e-2
"""Ratio of eigenvalues below which normals around a point count as those of fewer planes."""


@dataclass(frozen=True, eq=False)
class BodyPoints:
    """Points of a body, and how they move when it grows."""

    points: Float[np.ndarray, "b 3"]
    """In the body's axes [m]."""
    push: Float[np.ndarray, "b 3"] | None
    """Way of each in a metre of growth, by which the planes around it move a metre; None: in proportion."""


def place_points(mesh: "trimesh.Trimesh", spacing: float) -> BodyPoints:
    """Fill a closed mesh around the origin with points at most about `spacing` [m] apart, closer in thin parts.

    Raises InvalidInputError for a part thinner than 1 mm, and for more than 5000 points.
    """
    thinnest = _least_thickness(mesh)
    if thinnest >= spacing:
        return BodyPoints(fill_with_points(mesh, spacing), None)
    share = 1.0
    while True:  # every round has fewer points, down to those that `spacing` asks for
        found = _fill_thin(mesh, max(FINEST, FOURTH * thinnest), spacing, share)
        if len(found.points) <= MANY or share * FINEST >= spacing:
            break
        share *= max(1.05, (len(found.points) / MANY) ** 0.5)
    if len(found.points) > MOST_POINTS:
        raise InvalidInputError(
            f"a body with points {spacing:g} m apart would have {len(found.points)} of them, more than {MOST_POINTS}: "
            "take a larger spacing"
        )
    return found


def fill_with_points(mesh: "trimesh.Trimesh", spacing: float) -> Float[np.ndarray, "b 3"]:
    """Fill a mesh around the origin with points on its surface and inside, in a fixed order."""
    import trimesh

    corners, faces = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, spacing)[:2]
    # of the surface, the point nearest to each node of a grid; of the inside, the middles of cells, clear of flat faces
    counts = np.ceil(mesh.extents / spacing).astype(int)
    axes = [edge * ((np.arange(n) + 0.5) / n - 0.5) for edge, n in zip(mesh.extents, counts, strict=True)]
    grid = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    surface = corners[np.unique(faces)]
    cell = np.round(surface / spacing).astype(int)
    nearness = np.linalg.norm(surface - cell * spacing, axis=-1)
    order = np.lexsort((nearness, *cell.T))
    _, first = np.unique(cell[order], axis=0, return_index=True)
    return np.concatenate([surface[order[first]], grid[mesh.contains(grid)]])


def _least_thickness(mesh: "trimesh.Trimesh") -> float:
    """Measure the thickness of the thinnest part [m]. Raises InvalidInputError for less than 1 mm."""
    size = max(0.2 * float(mesh.extents.max()), (4 * mesh.area / _PLACES) ** 0.5)
    faces = divide_until(np.asarray(mesh.triangles, float), longest_edges, size)
    faces = faces[np.unique(np.linspace(0, len(faces) - 1, _PLACES).astype(int))]
    across = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    area = np.linalg.norm(across, axis=-1, keepdims=True)
    faces, inwards = faces[area[:, 0] > 0], -(across / np.where(area > 0, area, 1.0))[area[:, 0] > 0]
    lengths, facing = _depths(mesh, faces.mean(1), inwards)
    plates = lengths[facing < _OPPOSITE]
    if (plates < THINNEST * (1 - 1e-6)).any():
        raise InvalidInputError(
            f"a part of the body is {1000 * plates.min():.2g} mm thick, and 1 mm is the least: "
            "is the mesh in other units?"
        )
    return float(lengths[facing < _TAPERED].min(initial=np.inf))


def _depths(
    mesh: "trimesh.Trimesh", points: Float[np.ndarray, "n 3"], inwards: Float[np.ndarray, "n 3"]
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Measure the way from points of the surface through the solid along unit vectors [m], infinite where rounding
    hides its end, and the cosine between each vector and the inwards normal there."""
    # from just below the surface, so that a ray does not end where it begins
    places, ray, face = mesh.ray.intersects_location(points + 1e-3 * THINNEST * inwards, inwards)
    along = np.linalg.norm(places - points[ray], axis=-1)
    lengths, facing = np.full(len(points), np.inf), np.zeros(len(points))
    order = np.argsort(-along, kind="stable")  # the nearest one is written last
    lengths[ray[order]] = along[order]
    facing[ray[order]] = -(mesh.face_normals[face] * inwards[ray]).sum(-1)[order]
    return lengths, facing


def _fill_thin(mesh: "trimesh.Trimesh", least: float, spacing: float, share: float) -> BodyPoints:
    """Choose points as far apart as the thickness at each asks, at least `least`, times `share`, and at most `spacing`
    [m]."""
    import trimesh

    size = max(0.5 * min(spacing, share * least), (2 * mesh.area / _CANDIDATES) ** 0.5)
    faces = divide_until(np.asarray(mesh.triangles, float), longest_edges, size)
    fine = trimesh.Trimesh(faces.reshape(-1, 3), np.arange(3 * len(faces)).reshape(-1, 3))  # merges what faces share
    surface, push = np.asarray(fine.vertices), push_of(fine)
    first = np.argsort(-np.linalg.norm(push, axis=-1).round(1), kind="stable")  # corners, then edges, then faces
    surface, push = surface[first], push[first]
    outward = push / np.linalg.norm(push, axis=-1, keepdims=True)
    thickness = np.minimum(_depths(mesh, surface, -outward)[0], float(mesh.extents.max()))
    apart = np.minimum(spacing, share * np.maximum(FINEST, FOURTH * thickness))
    kept = _spread(surface, apart, outward)
    inside, distances = _layers(surface[kept], outward[kept], thickness[kept], apart[kept])
    inside, distances = inside[solid := mesh.contains(inside)], distances[solid]
    within = _spread(inside, distances, None)
    points = np.concatenate([surface[kept], inside[within]])
    return BodyPoints(points, np.concatenate([push[kept], np.zeros((int(within.sum()), 3))]))


def _layers(
    surface: Float[np.ndarray, "n 3"],
    outward: Float[np.ndarray, "n 3"],
    thickness: Float[np.ndarray, " n"],
    apart: Float[np.ndarray, " n"],
) -> tuple[Float[np.ndarray, "m 3"], Float[np.ndarray, " m"]]:
    """Place points below the surface, `apart` from layer to layer and in the middle, and give their distance [m]."""
    found, distances = [np.zeros((0, 3))], [np.zeros(0)]
    half, depth = 0.5 * thickness, apart.copy()
    deep = thickness > 2 * apart
    while deep.any():
        down = np.minimum(depth, half)[deep]
        found.append(surface[deep] - down[:, None] * outward[deep])
        distances.append(apart[deep])
        deep &= depth < half
        depth += apart
    return np.concatenate(found), np.concatenate(distances)


def _spread(
    points: Float[np.ndarray, "n 3"], apart: Float[np.ndarray, " n"], outward: Float[np.ndarray, "n 3"] | None
) -> Bool[np.ndarray, " n"]:
    """Mark points of which none is nearer to an earlier one than that one's distance [m], on the same side."""
    kept, covered = np.zeros(len(points), bool), np.zeros(len(points), bool)
    if len(points) == 0:
        return kept
    tree = scipy.spatial.KDTree(points)
    for index in range(len(points)):
        if covered[index]:
            continue
        near = np.array(tree.query_ball_point(points[index], 0.999 * apart[index]))
        covered[near if outward is None else near[outward[near] @ outward[index] > 0]] = True
        kept[index] = True
    return kept


def push_of(mesh: "trimesh.Trimesh") -> Float[np.ndarray, "v 3"]:
    """Compute the way m of each vertex with m . n = 1 for the normals n of the faces around it, so that all of them
    move outwards by as much as the body grows: the least of such ways, at most that of a box's corner."""
    normals, count = mesh.face_normals, len(mesh.faces)
    places = (np.asarray(mesh.faces).ravel(), np.repeat(np.arange(count), 3))
    around = scipy.sparse.csr_matrix((np.ones(3 * count), places), (len(mesh.vertices), count))
    square = (around @ (normals[:, :, None] * normals[:, None]).reshape(count, 9)).reshape(-1, 3, 3)
    total = around @ normals
    push = (np.linalg.pinv(square, rcond=_ONE_PLANE, hermitian=True) @ total[..., None])[..., 0]
    length = np.linalg.norm(push, axis=-1, keepdims=True)
    # where normals cancel out, on a blade's edge, any way outwards will do
    push = np.where(length > _ONE_PLANE, push, mesh.vertex_normals)
    return push * np.minimum(1.0, _LONGEST_PUSH / np.maximum(length, 1.0))
