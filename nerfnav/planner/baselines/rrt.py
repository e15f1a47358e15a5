"""RRT on the mesh of a field: a ball grown through free space, then flown along by a controller; a baseline.

(LaValle, "Rapidly-exploring random trees", 1998, as implemented in OMPL.) The mesh is the field's level set by
marching cubes, so that this planner, too, has nothing but the field. `BallCheck` checks that a ball fits between its
triangles.
"""

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.extras import import_extra
from nerfnav.field import Field, field_mesh
from nerfnav.geometry import Box
from nerfnav.planner.baselines.geometric_controller import Reference, TrackingConfig, track
from nerfnav.planner.baselines.waypoint_following import plan_along
from nerfnav.planner.objective.problem import PlanProblem, checked_map
from nerfnav.planner.objective.safety import downgrade_outcome
from nerfnav.planner.risk.costs import CostWeights
from nerfnav.planner.space.astar import smooth_path, waypoints_along
from nerfnav.planner.space.occupancy import OccupancyConfig, OccupancyMap
from nerfnav.planner.steps import PlanOutcome, PlanResult
from nerfnav.robots import Quadrotor, Robot

if TYPE_CHECKING:
    import trimesh


class BallCheck:
    """Check of a ball of one radius against a closed mesh whose triangles face outwards.

    The nearest triangle's middle decides nearly always; the few balls that are about as near as triangles are large
    are measured against the triangles themselves.
    """

    def __init__(self, mesh: "trimesh.Trimesh", radius: float) -> None:
        """Index a mesh, which may be empty, for balls of `radius` [m]."""
        self.radius = radius
        self._triangles = np.asarray(mesh.triangles, dtype=np.float64)
        self._tree = None
        if len(self._triangles):
            self._centers = self._triangles.mean(1)
            self._normals = np.cross(*np.moveaxis(self._triangles[:, 1:] - self._triangles[:, :1], 1, 0))
            self._reach = float(np.linalg.norm(self._triangles - self._centers[:, None], axis=-1).max())
            self._tree = scipy.spatial.KDTree(self._centers)

    def fits(self, point: np.ndarray) -> bool:
        """Return True if the ball at `point` (3,) [m] is outside of the mesh and clear of every triangle."""
        if self._tree is None:
            return True
        distance, nearest = self._tree.query(point)
        if distance <= self.radius:
            return False
        if distance > self.radius + self._reach:
            return bool((point - self._centers[nearest]) @ self._normals[nearest] > 0)
        import trimesh  # seldom needed, and slow to import

        near = self._tree.query_ball_point(point, distance + self._reach)
        away = point - trimesh.triangles.closest_point(self._triangles[near], np.tile(point, (len(near), 1)))
        apart = np.linalg.norm(away, axis=-1)
        # several triangles share the closest edge or corner: the one that the point faces most squarely knows the side
        closest = np.flatnonzero(apart <= apart.min() + 1e-9)
        facing = np.einsum("na,na->n", away[closest], self._normals[near][closest])
        return bool(apart.min() > self.radius and facing[np.abs(facing).argmax()] > 0)


_LEAVING, _LEAVING_STEP = 2.2, 0.275
"""Distance from an end within which a place for the ball is searched, and step of that search, in radii of the ball."""
_BRANCH, _CHECKS = 2.7, 0.135
"""Longest branch, and distance of the points at which one is checked, in radii of the ball: 20 cm and 1 cm for the
paper's robot."""


@dataclass(frozen=True)
class RRTConfig:
    """Settings of the growth of a tree."""

    seed: int = 1
    """Seed of the tree's random points, at least 1."""
    time_limit: float = 5.0
    """Longest search [s]."""
    reach: float | None = None
    """Longest branch [m]; None: as the ball is large."""
    goal_bias: float = 0.05
    """Share of the branches that aim at the goal."""
    resolution: float | None = None
    """Distance of the points at which a branch is checked [m]; None: as the ball is large."""
    mesh_spacing: float | None = None
    """Distance of the samples that the mesh is made from [m]; None: half a voxel of maps (see Scales)."""
    mesh_level: float | None = None
    """Density of the mesh's surface [1/m], above which a place counts as occupied; None: as on maps."""
    weights: CostWeights = field(default_factory=CostWeights)
    """Weights of the terms of J, which is reported only."""
    occupancy: OccupancyConfig = field(default_factory=OccupancyConfig)
    """Settings of the occupancy map on which start and goal are checked."""
    tracking: TrackingConfig = field(default_factory=TrackingConfig)
    """Settings of the controller."""

    @property
    def iterations(self) -> int:
        """Return 1: one tree."""
        return 1


def plan_rrt(
    problem: PlanProblem,
    config: RRTConfig | None = None,
    occupancy: OccupancyMap | None = None,
    check: BallCheck | None = None,
) -> PlanResult:
    """Plan from scratch; return the motion that the controller flew, which nearly ends at the goal.

    `occupancy` and `check` save making them again where the caller has them.

    Raises InvalidInputError, OutsideBoxError or OccupiedError for ends that cannot be planned between, and
    MissingExtraError where OMPL is not installed.
    """
    config, robot = config or RRTConfig(), problem.robot
    if robot.planar:
        raise InvalidInputError(
            f"the planner rrt moves a ball through the air, but a {robot.name} stays on the ground: use another one"
        )
    checked_map(problem, occupancy or config.occupancy)
    check = check or ball_check(problem.field, robot, config)
    path = grow(check, problem.field.box, problem.start.position, problem.goal.position, config)
    if path is None:
        straight = torch.stack([problem.start.position, problem.goal.position])
        waypoints = waypoints_along(straight, problem.start, problem.goal, problem.steps)
        return plan_along(problem, waypoints, config.weights, PlanOutcome.TIME_LIMIT)
    return fly_along(problem, path, config)


def fly_along(problem: PlanProblem, path: Float[Tensor, "n 3"], config: RRTConfig) -> PlanResult:
    """Ease along a path [m], its corners rounded as those of A* are.

    Around the bare corners of a tree the controller would need 20 times the effort.
    """
    waypoints = waypoints_along(smooth_path(path), problem.start, problem.goal, problem.steps)
    planned = plan_along(problem, waypoints, config.weights, PlanOutcome.CONVERGED)
    flown = planned.motion  # a robot without a controller moves as its flatness map says
    if isinstance(problem.robot, Quadrotor):
        reference = Reference(waypoints[:, :3], waypoints[:, 3], problem.dt)
        flown = track(problem.robot, problem.start, reference, problem.steps, config.tracking)
    with torch.no_grad():
        cost = problem.cost(flown, config.weights).numbers()
    return replace(planned, motion=flown, cost=cost, outcome=downgrade_outcome(problem, flown, PlanOutcome.CONVERGED))


def ball_check(field: Field, robot: Robot, config: RRTConfig) -> BallCheck:
    """Make the check of a ball around the robot against the field's surface; it takes longer than most searches."""
    return BallCheck(search_mesh(field, robot, config), robot.body.radius)


def search_mesh(field: Field, robot: Robot, config: RRTConfig) -> "trimesh.Trimesh":
    """Make the mesh of a field that trees are grown around."""
    scales = config.occupancy.scales(field, robot.body)
    spacing = 0.5 * scales.voxel if config.mesh_spacing is None else config.mesh_spacing
    level = scales.threshold if config.mesh_level is None else config.mesh_level
    return field_mesh(field, spacing, level)


def grow(
    check: BallCheck, box: Box, start: Float[Tensor, "3"], goal: Float[Tensor, "3"], config: RRTConfig
) -> Float[Tensor, "n 3"] | None:
    """Search a path [m] of a ball's centre from start to goal; None where none was found in time.

    An end that is nearer to a surface than the ball is large is left on the shortest line to where the ball fits.
    """
    if config.seed < 1:
        raise InvalidInputError(f"the seed of a tree must be 1 or more, not {config.seed}")
    ends = [room_near(check, box, end) for end in (start, goal)]
    if ends[0] is None or ends[1] is None:
        return None
    inner = _tree(check, box, (ends[0], ends[1]), config)
    if inner is None:
        return None
    return torch.cat([start[None], torch.from_numpy(inner).to(start), goal[None]])


def room_near(check: BallCheck, box: Box, point: Float[Tensor, "3"]) -> np.ndarray | None:
    """Find the nearest point at which the ball fits [m]; None where there is none within reach."""
    center = point.double().numpy()
    reach = round(_LEAVING / _LEAVING_STEP)
    axis = check.radius * _LEAVING_STEP * np.arange(-reach, reach + 1)
    offsets = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1).reshape(-1, 3)
    lower, upper = (edge.double().numpy() for edge in _for_centers(check, box))
    for offset in offsets[np.argsort(np.linalg.norm(offsets, axis=-1), kind="stable")]:
        place = center + offset
        if ((place >= lower) & (place <= upper)).all() and check.fits(place):
            return place
    return None


def _for_centers(check: BallCheck, box: Box) -> tuple[Float[Tensor, "3"], Float[Tensor, "3"]]:
    """Shrink the box to the places of the ball's centre with all of it inside (see space/border.py): lower and upper
    corner [m]."""
    return box.lower + check.radius, box.upper - check.radius


def _tree(check: BallCheck, box: Box, ends: tuple[np.ndarray, np.ndarray], config: RRTConfig) -> np.ndarray | None:
    base, geometric, util = (_ompl(part) for part in ("base", "geometric", "util"))
    util.setLogLevel(util.LOG_NONE)
    util.RNG.setSeed(config.seed)
    space, bounds = base.RealVectorStateSpace(3), base.RealVectorBounds(3)
    lower, upper = _for_centers(check, box)
    for axis in range(3):
        bounds.setLow(axis, lower[axis].item())
        bounds.setHigh(axis, upper[axis].item())
    space.setBounds(bounds)
    setup = geometric.SimpleSetup(space)
    setup.setStateValidityChecker(lambda state: check.fits(np.array([state[0], state[1], state[2]])))
    resolution = _CHECKS * check.radius if config.resolution is None else config.resolution
    setup.getSpaceInformation().setStateValidityCheckingResolution(resolution / space.getMaximumExtent())
    states = [space.allocState() for _ in ends]
    for state, end in zip(states, ends, strict=True):
        for axis in range(3):
            state[axis] = float(end[axis])
    setup.setStartAndGoalStates(*states, resolution)
    planner = geometric.RRT(setup.getSpaceInformation())
    planner.setRange(_BRANCH * check.radius if config.reach is None else config.reach)
    planner.setGoalBias(config.goal_bias)
    setup.setPlanner(planner)
    setup.solve(config.time_limit)
    if not setup.haveExactSolutionPath():
        return None
    path = setup.getSolutionPath().getStates()
    return np.array([[state[axis] for axis in range(3)] for state in path])


def require_ompl() -> None:
    """Raise MissingExtraError where OMPL, which grows the tree, is not installed."""
    _ompl("geometric")


def _ompl(part: str) -> Any:
    return import_extra(f"ompl.{part}", "baselines", "the planner rrt")
