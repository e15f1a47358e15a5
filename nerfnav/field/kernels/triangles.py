"""Triangles on a grid: nearest triangle and its distance, grid edges that triangles cross, growth between surfaces.

Nodes stand at lower + (i, j, k) spacing. Distances and crossings are exact.
"""

import math

import numpy as np

from nerfnav.core.jit import kernel, prange

SLAB = 8
"""Layers of nodes along x that one thread fills."""


@kernel()
def dot(ax, ay, az, bx, by, bz):
    """Scalar product of two vectors."""
    return ax * bx + ay * by + az * bz


@kernel()
def squared_distance(px, py, pz, t):
    """Squared distance of a point from a triangle `t` (3, 3), by the region of its plane that is nearest (Ericson,
    "Real-Time Collision Detection", 2005, section 5.1.5)."""
    abx, aby, abz = t[1, 0] - t[0, 0], t[1, 1] - t[0, 1], t[1, 2] - t[0, 2]
    acx, acy, acz = t[2, 0] - t[0, 0], t[2, 1] - t[0, 1], t[2, 2] - t[0, 2]
    apx, apy, apz = px - t[0, 0], py - t[0, 1], pz - t[0, 2]
    d1, d2 = dot(abx, aby, abz, apx, apy, apz), dot(acx, acy, acz, apx, apy, apz)
    bpx, bpy, bpz = px - t[1, 0], py - t[1, 1], pz - t[1, 2]
    d3, d4 = dot(abx, aby, abz, bpx, bpy, bpz), dot(acx, acy, acz, bpx, bpy, bpz)
    cpx, cpy, cpz = px - t[2, 0], py - t[2, 1], pz - t[2, 2]
    d5, d6 = dot(abx, aby, abz, cpx, cpy, cpz), dot(acx, acy, acz, cpx, cpy, cpz)
    va, vb, vc = d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2
    v, w = 0.0, 0.0
    if d1 <= 0.0 and d2 <= 0.0:
        pass
    elif d3 >= 0.0 and d4 <= d3:
        v = 1.0
    elif d6 >= 0.0 and d5 <= d6:
        w = 1.0
    elif vc <= 0.0 and d1 >= 0.0 and d3 <= 0.0:
        v = d1 / (d1 - d3)
    elif vb <= 0.0 and d2 >= 0.0 and d6 <= 0.0:
        w = d2 / (d2 - d6)
    elif va <= 0.0 and d4 >= d3 and d5 >= d6:
        w = (d4 - d3) / ((d4 - d3) + (d5 - d6))
        v = 1.0 - w
    else:
        total = va + vb + vc
        v, w = vb / total, vc / total
    x, y, z = apx - v * abx - w * acx, apy - v * aby - w * acy, apz - v * abz - w * acz
    return x * x + y * y + z * z


@kernel()
def first_node(low, lower, spacing):
    """The first node at or above a coordinate [m]; 0 below the grid."""
    return max(0, math.ceil((low - lower) / spacing))


@kernel()
def last_node(high, lower, spacing, count):
    """The last node at or below a coordinate [m]; count - 1 above the grid."""
    return min(count - 1, math.floor((high - lower) / spacing))


@kernel(parallel=True)
def nearest_triangles(triangles, normals, lower, spacing, band, distance, nearest):
    """Fill `distance` [m] and `nearest` (nx, ny, nz) of nodes within `band` [m] of triangles (f, 3, 3).

    `normals` (f, 3) are of unit length. Other nodes keep what they hold: infinity and -1.
    """
    nx, ny, nz = distance.shape
    for slab in prange((nx + SLAB - 1) // SLAB):
        begin, end = slab * SLAB, min(nx, slab * SLAB + SLAB)
        for face in range(triangles.shape[0]):
            t, n = triangles[face], normals[face]
            i0 = max(begin, first_node(min(t[0, 0], t[1, 0], t[2, 0]) - band, lower[0], spacing[0]))
            i1 = min(end - 1, last_node(max(t[0, 0], t[1, 0], t[2, 0]) + band, lower[0], spacing[0], nx))
            if i0 > i1:
                continue
            j0 = first_node(min(t[0, 1], t[1, 1], t[2, 1]) - band, lower[1], spacing[1])
            j1 = last_node(max(t[0, 1], t[1, 1], t[2, 1]) + band, lower[1], spacing[1], ny)
            k0 = first_node(min(t[0, 2], t[1, 2], t[2, 2]) - band, lower[2], spacing[2])
            k1 = last_node(max(t[0, 2], t[1, 2], t[2, 2]) + band, lower[2], spacing[2], nz)
            offset = dot(n[0], n[1], n[2], t[0, 0], t[0, 1], t[0, 2])
            for i in range(i0, i1 + 1):
                x = lower[0] + i * spacing[0]
                for j in range(j0, j1 + 1):
                    y = lower[1] + j * spacing[1]
                    level = n[0] * x + n[1] * y - offset
                    for k in range(k0, k1 + 1):
                        z = lower[2] + k * spacing[2]
                        least = min(distance[i, j, k], band)
                        if abs(level + n[2] * z) >= least:
                            continue
                        apart = squared_distance(x, y, z, t)
                        if apart < least * least:
                            distance[i, j, k] = math.sqrt(apart)
                            nearest[i, j, k] = face


_TOUCH = 1e-9
"""Share of a triangle by which a grid line may miss it: lines along shared edges cross one of both faces."""


@kernel()
def cross_edges(triangles, normals, lower, spacing, reached, crossed, behind):
    """Set bit `axis` of `crossed` (nx, ny, nz) for the edge from a node along an axis that a triangle crosses.

    Of an edge whose ends are both `reached`, the end behind the triangle, as its normal says, is set in `behind`.
    """
    shape = crossed.shape
    node, other = np.zeros(3, np.int64), np.zeros(3, np.int64)
    for face in range(triangles.shape[0]):
        t, n = triangles[face], normals[face]
        for axis in range(3):
            u, v = (axis + 1) % 3, (axis + 2) % 3
            if n[axis] == 0.0:
                continue
            area = (t[1, u] - t[0, u]) * (t[2, v] - t[0, v]) - (t[1, v] - t[0, v]) * (t[2, u] - t[0, u])
            if area == 0.0:
                continue
            i0 = first_node(min(t[0, u], t[1, u], t[2, u]), lower[u], spacing[u])
            i1 = last_node(max(t[0, u], t[1, u], t[2, u]), lower[u], spacing[u], shape[u])
            j0 = first_node(min(t[0, v], t[1, v], t[2, v]), lower[v], spacing[v])
            j1 = last_node(max(t[0, v], t[1, v], t[2, v]), lower[v], spacing[v], shape[v])
            for i in range(i0, i1 + 1):
                pu = lower[u] + i * spacing[u] - t[0, u]
                for j in range(j0, j1 + 1):
                    pv = lower[v] + j * spacing[v] - t[0, v]
                    b = (pu * (t[2, v] - t[0, v]) - pv * (t[2, u] - t[0, u])) / area
                    c = (pv * (t[1, u] - t[0, u]) - pu * (t[1, v] - t[0, v])) / area
                    if b < -_TOUCH or c < -_TOUCH or b + c > 1.0 + _TOUCH:
                        continue
                    met = t[0, axis] + b * (t[1, axis] - t[0, axis]) + c * (t[2, axis] - t[0, axis])
                    k = math.floor((met - lower[axis]) / spacing[axis])
                    if k < 0 or k + 1 >= shape[axis]:
                        continue
                    node[u], node[v], node[axis] = i, j, k
                    other[u], other[v], other[axis] = i, j, k + 1
                    crossed[node[0], node[1], node[2]] |= 1 << axis
                    if reached[node[0], node[1], node[2]] and reached[other[0], other[1], other[2]]:
                        if n[axis] > 0.0:
                            behind[node[0], node[1], node[2]] = True
                        else:
                            behind[other[0], other[1], other[2]] = True


SEED, GROWN = 1, 2
"""Nodes that were reached before a growth, and in it."""


@kernel()
def spread(reached, distance, crossed, least, i, j, k, found, count):
    """Reach the neighbours of a node that `grow` may; append them to `found` from `count` on, and return their end."""
    for axis in range(3):
        for side in range(-1, 2, 2):
            a, b, c = i + (side if axis == 0 else 0), j + (side if axis == 1 else 0), k + (side if axis == 2 else 0)
            if not (0 <= a < reached.shape[0] and 0 <= b < reached.shape[1] and 0 <= c < reached.shape[2]):
                continue
            if reached[a, b, c] or distance[a, b, c] <= least:
                continue
            barred = crossed[a, b, c] if side < 0 else crossed[i, j, k]
            if not barred & (1 << axis):
                reached[a, b, c] = GROWN
                found[count, 0], found[count, 1], found[count, 2] = a, b, c
                count += 1
    return count


@kernel()
def grow(reached, distance, crossed, least, steps, found):
    """Grow `reached` (nx, ny, nz) in place by so many steps along edges that are not crossed, to nodes farther than
    `least` [m]; `found` (n, 3), with room for all nodes that are not reached, is overwritten."""
    nx, ny, nz = reached.shape
    count = 0
    for i in range(nx):
        for j in range(ny):
            for k in range(nz):
                if reached[i, j, k] == SEED:
                    count = spread(reached, distance, crossed, least, i, j, k, found, count)
    begin = 0
    for _ in range(1, steps):
        end = count
        for index in range(begin, end):
            i, j, k = found[index, 0], found[index, 1], found[index, 2]
            count = spread(reached, distance, crossed, least, i, j, k, found, count)
        begin = end


REACH = 1.5
"""Nodes get colours so far from the surface [voxels], from samples within the root of it around their nearest point."""


@kernel()
def splat_colors(grid, samples, surface, signed, sums):
    """Add to `sums` (nx, ny, nz, 4: weight and colour) the Gaussian mean of samples around each node's nearest point.

    `grid` = (lower, spacing, voxel [m]); `samples` = (points (n, 3), colors (n, 3), faces (n,)); `surface` = (normals
    (f, 3), one point of each triangle (f, 3), facing (f,): 1 or -1 where only the space before or behind a face sees
    it, 0 where both do, or it is not known; nearest (nx, ny, nz)); `signed` (nx, ny, nz) is the distance from the
    surface, negative inside [m]. Only samples that the node's side of the surface sees count.
    """
    lower, spacing, voxel = grid
    points, colors, faces = samples
    normals, corners, facing, nearest = surface
    nx, ny, nz = signed.shape
    farthest = 1.001 * (REACH + REACH * REACH) * voxel * voxel  # of what is near enough by both tests below
    for sample in range(points.shape[0]):
        x, y, z, face = points[sample, 0], points[sample, 1], points[sample, 2], faces[sample]
        i0, j0 = int((x - lower[0]) / spacing[0]) - 1, int((y - lower[1]) / spacing[1]) - 1
        k0 = int((z - lower[2]) / spacing[2]) - 1
        for i in range(max(0, i0), min(nx, i0 + 4)):
            ox = lower[0] + i * spacing[0] - x
            for j in range(max(0, j0), min(ny, j0 + 4)):
                oy = lower[1] + j * spacing[1] - y
                if ox * ox + oy * oy > farthest:
                    continue
                for k in range(max(0, k0), min(nz, k0 + 4)):
                    oz = lower[2] + k * spacing[2] - z
                    apart = ox * ox + oy * oy + oz * oz
                    if apart > farthest:
                        continue
                    s, near = signed[i, j, k], nearest[i, j, k]
                    if near < 0 or abs(s) > REACH * voxel:
                        continue
                    along = apart - s * s
                    if along > REACH * voxel * voxel:
                        continue
                    ahead = facing[face] * dot(normals[face, 0], normals[face, 1], normals[face, 2], ox, oy, oz)
                    if ahead * (1.0 if s > 0.0 else -1.0) < -0.05 * voxel:
                        continue
                    if s <= 0.0:  # of a thin wall, the inside is coloured from the nearer side alone
                        m, a = normals[near], corners[near]
                        side = dot(m[0], m[1], m[2], ox + x - a[0], oy + y - a[1], oz + z - a[2])
                        if side * dot(m[0], m[1], m[2], ox, oy, oz) < 0.0:
                            continue
                    weight = math.exp(-2.0 * along / (voxel * voxel))
                    sums[i, j, k, 0] += weight
                    for channel in range(3):
                        sums[i, j, k, 1 + channel] += weight * colors[sample, channel]
