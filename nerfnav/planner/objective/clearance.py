"""Clearance: smallest distance of a body's surface from dense space, for any shape, to half a millimetre.

Let q be the dense point nearest to the body, s the point of the body nearest to q, and S the corner, edge or face that
s lies within (robots/surface.py). Then q - s is at right angles to S, so that for the middle c of S, rho from its
farthest corner and d(c) from dense space,

    |q - s|^2 = |q - c|^2 - |s - c|^2 >= d(c)^2 - rho^2

A branch-and-bound search splits those S in which that may be less than the smallest distance found so far. Balls are
corners with a radius that is taken off.
"""

import math
from dataclasses import dataclass

import numpy as np
import scipy
import torch
from jaxtyping import Bool, Float, Int
from torch import Tensor

from nerfnav.field import Field, GridField, density_and_gradient
from nerfnav.field.core.occupancy import raw_of
from nerfnav.geometry import spacing_of
from nerfnav.planner.kernels.maps import bisect_entries, nearest_dense
from nerfnav.planner.space.border import room_to_border
from nerfnav.planner.space.occupancy import dense_at
from nerfnav.planner.space.scales import poses_along, scales_of
from nerfnav.robots import Body, BodySurface, Motion, RigidState
from nerfnav.robots.surface import radii_of, split

_BISECTIONS, _SLIDES, _HALVINGS = 12, 2, 7
_MOST_SAMPLES = 4_000_000
_TOLERANCE = 0.0005
"""Distance by which a part must promise to be nearer than what was found [m] to be looked at more closely."""
_PART = 0.15
"""Size of the parts that the search begins with, as a share of the body's radius."""
_ROUNDS, _MOST_PARTS = 30, 30_000
"""Largest number of rounds of the search, and of parts that one splits: of a plate that slides along a wall, very many
are as near as the nearest, and the most promising are taken."""
_SETTLED = 64
"""Parts in each round, the most promising, whose distance is made exact at edges of the level set."""
_FLAT = 1e-9
"""Gradient of a density [1/m^2] that has no direction."""


@dataclass(frozen=True)
class SafetyConfig:
    """Settings of the safety of a plan."""

    threshold: float | None = None
    """Density of the level set that clearance is measured to [1/m]; None: that of maps."""
    reach: float | None = None
    """Distance from the plan within which dense space is searched [m]; None: five bodies."""
    voxel: float | None = None
    """Distance of the densities that are taken [m] in a field that is no grid: thinner things may be missed there.
    None: half a voxel of maps. Of a grid, all nodes are taken."""

    def lengths(self, field: Field, body: Body) -> tuple[float, float, float]:
        """Return threshold [1/m], reach and voxel [m] for a body in a field."""
        scales = scales_of(field, body, threshold=self.threshold)
        reach = scales.reach if self.reach is None else self.reach
        return scales.threshold, reach, 0.5 * scales.voxel if self.voxel is None else self.voxel


@torch.no_grad()
def measure_clearance(field: Field, motion: Motion, body: Body, config: SafetyConfig) -> float | None:
    """Measure the smallest distance of a body from the level set rho = threshold or the border of the field's box [m],
    along one motion, at poses at most half a voxel of maps apart; None where none is within reach."""
    threshold, reach, voxel = config.lengths(field, body)
    states, _ = poses_along(field, motion, body)
    points = body.points_at(states).to(field.box.lower)
    to_border = _room_to_border(field, states, body.surface)
    if to_border <= 0 or dense_at(field, points, threshold).any():
        return 0.0
    limit = min(reach, to_border)
    nearest = _Search(_Dense(field, threshold, voxel), states).run(points, body, limit)
    return nearest if nearest < limit else to_border if to_border <= reach else None


def _room_to_border(field: Field, states: RigidState, surface: BodySurface) -> float:
    """Measure the smallest distance of the body from the border of the box [m]; at most 0 beyond."""
    corners = torch.from_numpy(surface.corners[:, 0]).to(states.position)
    world = corners @ states.rotation.transpose(-1, -2) + states.position[..., None, :]
    room = room_to_border(field.box, world.reshape(-1, 3).to(field.box.lower)).reshape(world.shape[:-1])
    return (room - torch.from_numpy(surface.radii).to(room)).min().item()


@dataclass(frozen=True, eq=False)
class _Parts:
    """Corners, edges or faces of a body, each at one state."""

    state: Int[np.ndarray, " n"]
    simplices: Float[np.ndarray, "n k 3"]
    """In the body's axes [m]."""
    radii: Float[np.ndarray, " n"]
    """Radius of the ball around each [m]; 0 but for corners."""

    def select(self, chosen: np.ndarray) -> "_Parts":
        """Select some of the parts."""
        return _Parts(self.state[chosen], self.simplices[chosen], self.radii[chosen])

    def divided(self) -> "_Parts":
        """Split each; corners are done with."""
        if self.simplices.shape[1] == 1:
            return self.select(np.zeros(len(self.state), bool))
        return _Parts(np.tile(self.state, 2), split(self.simplices), np.tile(self.radii, 2))


@dataclass
class _Search:
    """Branch-and-bound search for the smallest distance of a body's surface from dense space."""

    dense: "_Dense"
    states: RigidState
    best: float = math.inf
    """Smallest distance that was found [m]."""

    def run(self, points: Float[Tensor, "n b 3"], body: Body, limit: float) -> float:
        """Search below a limit [m], from the body's points at the states on; the limit where nothing is nearer."""
        self.best = limit
        active = self._begin(points, body)
        states = np.unique(np.concatenate([parts.state for parts in active])) if active else np.zeros(0, int)
        self._refine(active, states)
        return max(self.best, 0.0)

    def _begin(self, points: Float[Tensor, "n b 3"], body: Body) -> list[_Parts]:
        """Collect the parts of the surface near those body points that are near dense space."""
        surface = body.surface.divided(_PART * body.radius)
        groups = [(surface.corners, surface.radii)]
        groups += [(each, np.zeros(len(each))) for each in (surface.edges, surface.faces)]
        tree = scipy.spatial.KDTree(body.points_body.double().cpu().numpy())
        owners = [tree.query(simplices.mean(1))[1] for simplices, _ in groups]
        cover = np.zeros(tree.n)  # distance from each body point within which the parts next to it lie [m]
        for (simplices, radii), owner in zip(groups, owners, strict=True):
            away = np.linalg.norm(simplices - tree.data[owner][:, None], axis=-1).max(1, initial=0.0) + radii
            np.maximum.at(cover, owner, away)
        most, slack = float(cover.max()), self.dense.slack
        flat = points.reshape(-1, 3)
        distance, places = self.dense.nearest(flat, self.best + most + slack, most + 2 * slack)
        if not torch.isfinite(distance).any():
            return []
        near = distance <= distance.min() + slack
        away = (self.dense.enter(flat[near], places[near]) - flat[near]).norm(dim=-1)
        self.best = min(self.best, away.min().item())
        bound = distance.double().cpu().numpy().reshape(points.shape[:2]) - slack - cover
        found = []
        for (simplices, radii), owner in zip(groups, owners, strict=True):
            state, part = np.nonzero(bound[:, owner] < self.best)
            found.append(_Parts(state, simplices[part], radii[part]))
        return found

    def _refine(self, active: list[_Parts], states: np.ndarray) -> None:
        """Look at the parts of a body at some states more and more closely; half of the states after the other where
        they extend over much space."""
        if len(states) == 0:
            return
        active = [parts.select(np.isin(parts.state, states)) for parts in active]
        world = torch.cat([self._world(parts, parts.simplices) for parts in active]).double().cpu().numpy()
        reach = self.best + max(parts.radii.max(initial=0.0) for parts in active) + self.dense.slack
        lower, upper = world.min(0) - reach, world.max(0) + reach
        if np.prod((upper - lower) / self.dense.step) > _MOST_SAMPLES and len(states) > 1:
            for some in np.array_split(states, 2):
                self._refine(active, some)
            return
        near = self.dense.within(lower, upper)
        for _ in range(_ROUNDS):
            if near is None or self.best <= 0 or not any(len(parts.state) for parts in active):
                return
            active = [self._look(parts, near) for parts in active]

    def _world(self, parts: _Parts, places: Float[np.ndarray, "n k 3"]) -> Float[Tensor, "m 3"]:
        """Place points of the body, k of each part, in the world [m]."""
        points = torch.from_numpy(places).to(self.states.position)
        rotation, position = self.states.rotation[parts.state], self.states.position[parts.state]
        world = points @ rotation.transpose(-1, -2) + position[:, None]
        return world.reshape(-1, 3).to(self.dense.field.box.lower)

    def _look(self, parts: _Parts, near: "_Samples") -> _Parts:
        """Measure the distance at the middles of parts, and return the parts of those that may be nearer."""
        if len(parts.state) == 0:
            return parts
        world = self._world(parts, parts.simplices.mean(1, keepdims=True))
        size = radii_of(parts.simplices)
        reach = math.hypot(self.best + parts.radii.max(), size.max()) + self.dense.slack
        distance, places = near.nearest(world, reach)
        met = torch.isfinite(distance)
        kept = met.cpu().numpy()
        parts, size = parts.select(kept), size[kept]
        if len(size) == 0:
            return parts
        world = world[met]
        surface = self.dense.enter(world, places[met])
        away = (surface - world).norm(dim=-1).double().cpu().numpy()
        first = np.argsort(_least(away, size) - parts.radii, kind="stable")[:_SETTLED]
        settled = self.dense.settle(world[first], surface[first])
        away[first] = (settled - world[first]).norm(dim=-1).double().cpu().numpy()
        self.best = min(self.best, float((away - parts.radii).min()))
        bound = _least(away, size) - parts.radii
        order = np.argsort(bound, kind="stable")[:_MOST_PARTS]
        return parts.select(order[bound[order] < self.best - _TOLERANCE]).divided()


def _least(away: Float[np.ndarray, " n"], size: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Bound the distance of parts of these sizes from what is `away` from their middles [m], from below."""
    return np.sqrt(np.maximum(away * away - size * size, 0.0))


@dataclass(frozen=True, eq=False)
class _Samples:
    """Dense samples next to others that are not, in a part of the box."""

    places: Float[Tensor, "n 3"]
    tree: "scipy.spatial.KDTree"  # quoted: it is slow to import

    @classmethod
    def of(cls, places: Float[Tensor, "n 3"]) -> "_Samples":
        """Index places [m] in a tree."""
        return cls(places, scipy.spatial.KDTree(places.cpu().numpy()))

    def nearest(self, points: Float[Tensor, "n 3"], reach: float) -> tuple[Tensor, Tensor]:
        """Find distance [m] and place of the sample nearest to each point; infinite where none is within reach."""
        distance, index = self.tree.query(points.cpu().numpy(), distance_upper_bound=reach)
        found = torch.from_numpy(np.minimum(index, self.tree.n - 1)).to(points.device)
        return torch.from_numpy(distance).to(points), self.places[found]


@dataclass(frozen=True)
class _Dense:
    """Space in which a field's density is above a threshold."""

    field: Field
    threshold: float
    """[1/m]."""
    voxel: float
    """Distance of samples [m] in a field that is no grid."""

    @property
    def step(self) -> np.ndarray:
        """Distance of samples along x, y, z [m]: that of a grid's nodes."""
        if not isinstance(self.field, GridField):
            return np.full(3, self.voxel)
        return spacing_of(self.field.box.to("cpu"), self.field.shape).double().numpy()

    @property
    def slack(self) -> float:
        """Largest distance from the level set to the dense node or sample next to it [m]."""
        return float(np.linalg.norm(self.step))

    def nearest(self, points: Tensor, reach: float, slack: float) -> tuple[Tensor, Tensor]:
        """Find distance [m] and place of the dense node or sample nearest to each point; infinite where it is not
        within `reach`, or another point is nearer by more than `slack` [m]."""
        if not isinstance(self.field, GridField):
            return self._nearest_samples(points, reach)
        at = points.double().cpu().numpy()
        nodes = np.zeros_like(at)
        distance = nearest_dense(*self.field.kernel_grid, raw_of(self.threshold), at, reach, slack, nodes)
        return torch.from_numpy(distance).to(points), torch.from_numpy(nodes).to(points)

    def _nearest_samples(self, points: Tensor, reach: float) -> tuple[Tensor, Tensor]:
        """Find the same among samples, some points after the other where they extend over much space."""
        lower, upper = (edge.double().cpu().numpy() for edge in (points.amin(0) - reach, points.amax(0) + reach))
        if np.prod((upper - lower) / self.step) > _MOST_SAMPLES and len(points) > 1:
            parts = [self._nearest_samples(part, reach) for part in points.tensor_split(2)]
            distances, places = zip(*parts, strict=True)
            return torch.cat(distances), torch.cat(places)
        near = self.within(lower, upper)
        if near is None:
            return points.new_full((len(points),), math.inf), points
        return near.nearest(points, reach)

    def within(self, lower: Float[np.ndarray, "3"], upper: Float[np.ndarray, "3"]) -> _Samples | None:
        """Collect the dense nodes of a grid, or samples, between two corners [m]; None where there is none."""
        box, step = self.field.box.to("cpu"), self.step
        first, last = (edge.double().numpy() for edge in (box.lower, box.upper))
        low = np.ceil((lower.clip(first) - first) / step - 1e-3).astype(int)
        high = np.floor((upper.clip(max=last) - first) / step + 1e-3).astype(int)
        if (low > high).any():
            return None
        axes = [torch.from_numpy(first[i] + step[i] * np.arange(low[i], high[i] + 1)) for i in range(3)]
        nodes = torch.stack(torch.meshgrid(*axes, indexing="ij"), -1).to(self.field.box.lower)
        dense = self.is_dense(nodes).cpu().numpy()
        outer = dense & ~scipy.ndimage.binary_erosion(dense)  # of those amid others, none is the nearest
        places = nodes[torch.from_numpy(outer).to(nodes.device)]
        return _Samples.of(places) if len(places) else None

    def is_dense(self, points: Float[Tensor, "*shape 3"]) -> Bool[Tensor, "*shape"]:
        """Mark points that are dense."""
        return dense_at(self.field, points, self.threshold).bool().to(points.device)

    def enter(self, points: Float[Tensor, "n 3"], nodes: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
        """Find the place of the level set nearest to each point, near its dense node [m]; dense points stay.

        From where the line to the node enters the level set, the search slides along its tangent plane to the foot of
        the point, as long as that is nearer.
        """
        solid = self._entry(points, nodes)
        for _ in range(_SLIDES):
            _, slope = density_and_gradient(self.field, solid.double().cpu().numpy())
            normal = torch.from_numpy(slope).to(points)
            steep = normal.norm(dim=-1, keepdim=True)
            normal = normal / steep.clamp_min(_FLAT)  # into what is dense
            aside = (solid - points) - ((solid - points) * normal).sum(-1, keepdim=True) * normal
            way = aside.norm(dim=-1, keepdim=True)
            foot = solid - aside * (self.slack / way.clamp_min(self.slack))
            ahead = foot - points
            behind = foot + 0.5 * self.slack * ahead / ahead.norm(dim=-1, keepdim=True).clamp_min(_FLAT)
            usable = self.is_dense(behind) & (steep[:, 0] > _FLAT)
            solid = _nearer(points, solid, self._entry(points, torch.where(usable[:, None], behind, solid)))
        return solid

    def settle(self, points: Float[Tensor, "n 3"], solid: Float[Tensor, "n 3"]) -> Float[Tensor, "n 3"]:
        """Find the same where the level set has edges, by a pattern search from the places that `enter` found."""
        sides = torch.cartesian_prod(*[torch.tensor([-1.0, 0.0, 1.0])] * 3).to(points)
        for halvings in range(_HALVINGS):
            around = solid[:, None] + self.slack * 0.5 ** (1 + halvings) * sides
            distance = (around - points[:, None]).norm(dim=-1)
            distance = torch.where(self.is_dense(around), distance, math.inf)
            least, chosen = distance.min(1)
            found = torch.where(torch.isfinite(least)[:, None], around[torch.arange(len(solid)), chosen], solid)
            solid = _nearer(points, solid, self._entry(points, found))
        return solid

    def _entry(self, points: Tensor, dense: Tensor) -> Tensor:
        """Find where the lines from points to dense ones enter the level set, by bisection."""
        if isinstance(self.field, GridField):
            free, solid = points.double().cpu().numpy().copy(), dense.double().cpu().numpy().copy()
            bisect_entries(*self.field.kernel_grid, raw_of(self.threshold), _BISECTIONS, free, solid)
            return torch.from_numpy(solid).to(points)
        free, solid = points, dense
        for _ in range(_BISECTIONS):
            middle = 0.5 * (free + solid)
            inside = self.is_dense(middle)[:, None]
            free, solid = torch.where(inside, free, middle), torch.where(inside, middle, solid)
        return solid


def _nearer(points: Tensor, first: Tensor, second: Tensor) -> Tensor:
    """Select of two places (n, 3) each the one that is nearer to its point."""
    better = (second - points).norm(dim=-1, keepdim=True) < (first - points).norm(dim=-1, keepdim=True)
    return torch.where(better, second, first)
