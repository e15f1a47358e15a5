"""Minimum snap: the smoothest curve through the turning points of the A* path; a baseline of the paper.

    minimise  integral |d^4 p / dt^4|^2 dt   over polynomials of degree 7 on each segment
    subject to  p(t_i) = w_i,  velocity .. snap continuous at inner knots,  given velocity, no acceleration and jerk
                at both ends

(Mellinger and Kumar, "Minimum snap trajectory generation and control for quadrotors", ICRA 2011; solved as one
linear system for the optimum's KKT conditions, as Richter, Bry and Roy, 2013, suggest.) Only the waypoints avoid
obstacles: between them the curve swings out as smoothness asks.
"""

from dataclasses import dataclass, field

import numpy as np
import scipy
import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.planner.baselines.waypoint_following import plan_along
from nerfnav.planner.objective.problem import PlanProblem, checked_map
from nerfnav.planner.polynomials import PiecewisePolynomial, derivative_rows, squared_derivative
from nerfnav.planner.risk.costs import CostWeights
from nerfnav.planner.space.astar import (
    SearchConfig,
    ease,
    find_paths,
    late_steps,
    lengths,
    scale_headings,
    waypoints_along,
)
from nerfnav.planner.space.occupancy import OccupancyConfig, OccupancyMap
from nerfnav.planner.steps import PlanOutcome, PlanResult

_TERMS, _SNAP = 8, 4
"""Coefficients of a polynomial of degree 7; the derivative that is minimised and up to which curves are continuous."""


@dataclass(frozen=True)
class MinSnapConfig:
    """Settings of minimum-snap trajectories along a path."""

    tolerance: float | None = None
    """Largest distance from the path of the straight lines between its turning points [m]; None: one and a half voxels
    of the map. Fewer points give calmer curves that cut corners."""
    time_steps: int = 30
    """Steps of the search for better times at the turning points; 0 keeps those of easing along the path."""
    weights: CostWeights = field(default_factory=CostWeights)
    """Weights of the terms of J, which is reported only."""
    occupancy: OccupancyConfig = field(default_factory=OccupancyConfig)
    """Settings of the occupancy map for A*."""

    @property
    def iterations(self) -> int:
        """Return 1: one linear system."""
        return 1


def plan_minimum_snap(
    problem: PlanProblem, config: MinSnapConfig | None = None, occupancy: OccupancyMap | None = None
) -> PlanResult:
    """Plan from scratch.

    `occupancy` saves making the map again where the caller has it. Raises InvalidInputError, OutsideBoxError or
    OccupiedError for ends that cannot be planned between.
    """
    config = MinSnapConfig() if config is None else config
    start, goal = problem.start, problem.goal
    occupancy = checked_map(problem, occupancy or config.occupancy)
    paths = find_paths(occupancy, start, goal, SearchConfig.single())
    path = paths[0] if paths else torch.stack([start.position, goal.position])
    tolerance = occupancy.scales.rounding if config.tolerance is None else config.tolerance
    corners = turning_points(path, tolerance)
    times = arrival_times(corners, problem.steps, problem.dt)
    times = best_times(corners, times, _with_no_turn(start.velocity, corners), config.time_steps)
    return through(problem, corners, times, config, PlanOutcome.CONVERGED if paths else PlanOutcome.NO_PATH)


def through(
    problem: PlanProblem,
    points: Float[Tensor, "knots c"],
    times: Float[Tensor, " knots"],
    config: MinSnapConfig,
    outcome: PlanOutcome,
) -> PlanResult:
    """The robot's motion along the minimum-snap curve through points [m] at times [s], begun a little late.

    Points may have the heading [rad] as a fourth number. A robot that must tilt before it can turn glides on
    meanwhile, and the curve begins where that takes it.
    """
    late, start = problem.dt * late_steps(problem.steps), problem.start
    leaving, arriving = (_with_no_turn(state.velocity, points) for state in (start, problem.goal))
    first, points, times = points[0], points.clone(), times.clone()
    points[0], times[0] = first + late * leaving, late
    when = problem.dt * torch.arange(problem.steps + 1)
    curve = minimum_snap(points, times, leaving, arriving)(when).to(first)
    waypoints = torch.where(when[:, None] < late, first + when[:, None] * leaving, curve)
    if points.shape[1] == 3:
        yaw = waypoints_along(points, start, problem.goal, problem.steps)[:, 3:]
        waypoints = torch.cat([waypoints, yaw], -1)
    return plan_along(problem, waypoints, config.weights, outcome)


def _with_no_turn(velocity: Float[Tensor, "3"], points: Float[Tensor, "knots c"]) -> Float[Tensor, " c"]:
    """A velocity, and no turning where the points have headings."""
    return torch.cat([velocity, velocity.new_zeros(points.shape[1] - 3)])


def minimum_snap(
    points: Float[Tensor, "knots axes"],
    times: Float[Tensor, " knots"],
    start_velocity: Float[Tensor, " axes"] | None = None,
    end_velocity: Float[Tensor, " axes"] | None = None,
) -> PiecewisePolynomial:
    """The curve through points [m] at times [s]; at rest at both ends unless velocities [m/s] are given.

    Raises InvalidInputError for fewer than two points, or times that do not rise.
    """
    points, times = points.double(), times.double()
    if len(points) < 2 or len(points) != len(times) or not (times.diff() > 0).all():
        raise InvalidInputError("minimum snap needs two points or more, each at a later time than the one before")
    rest = points.new_zeros(points.shape[1])
    speeds = torch.stack([rest if v is None else v.double() for v in (start_velocity, end_velocity)])
    scale = times.diff().mean()  # of time: without it the system's rows span many orders of magnitude
    solution, _ = _solve(points, times.diff() / scale, speeds * scale)
    return PiecewisePolynomial(times, solution)


def best_times(
    points: Float[Tensor, "knots c"], times: Float[Tensor, " knots"], start_velocity: Float[Tensor, " c"], effort: int
) -> Float[Tensor, " knots"]:
    """The inner times moved so that the least snap becomes smaller still, the last time kept, as Mellinger does.

    At most `effort` steps of L-BFGS over the logarithms of the spans.
    """
    points, total = points.double(), times[-1] - times[0]
    speeds = torch.stack([start_velocity, torch.zeros_like(start_velocity)]).double() * total

    def snap(logarithms: np.ndarray) -> tuple[float, np.ndarray]:
        free = torch.from_numpy(logarithms).requires_grad_()
        with torch.enable_grad():
            cost = _solve(points, free.softmax(0), speeds)[1].log()
            (slope,) = torch.autograd.grad(cost, free)
        return cost.item(), slope.numpy()

    if len(points) <= 2 or effort == 0:
        return times
    begin = times.double().diff().log().numpy()
    found = scipy.optimize.minimize(snap, begin, jac=True, method="L-BFGS-B", options={"maxiter": effort})
    spans = torch.from_numpy(found.x).softmax(0) * total
    return torch.cat([times[:1].double(), times[0] + spans.cumsum(0)])


def _solve(points: Tensor, spans: Tensor, speeds: Tensor) -> tuple[Tensor, Tensor]:
    """Coefficients (segments, 8, axes) of the least snap over spans, and that snap; speeds at both ends (2, axes)."""
    rows, wanted = _constraints(points, spans)
    wanted[-6], wanted[-3] = speeds[0], speeds[1]
    effort = torch.block_diag(*(squared_derivative(_SNAP, _TERMS) / span ** (2 * _SNAP - 1) for span in spans))
    none = torch.zeros(len(rows), len(rows), dtype=torch.float64)
    system = torch.cat([torch.cat([effort, rows.T], 1), torch.cat([rows, none], 1)])
    target = torch.cat([torch.zeros(len(effort), points.shape[1], dtype=torch.float64), wanted])
    solution = torch.linalg.solve(system, target)[: len(effort)]
    return solution.unflatten(0, (len(spans), _TERMS)), (solution * (effort @ solution)).sum()


def _constraints(points: Tensor, spans: Tensor) -> tuple[Tensor, Tensor]:
    """Rows (m, 8 segments) and wanted values (m, axes): passing, continuity, then three derivatives at each end."""
    count = len(spans)

    def row(segment: int, u: float, order: int) -> Tensor:
        whole = torch.zeros(count, _TERMS, dtype=torch.float64)
        whole[segment] = derivative_rows(torch.tensor([u]), order, _TERMS)[0] / spans[segment] ** order
        return whole.flatten()

    passing = [row(segment, u, 0) for segment in range(count) for u in (0.0, 1.0)]
    smooth = [row(k, 1.0, order) - row(k + 1, 0.0, order) for k in range(count - 1) for order in range(1, _SNAP + 1)]
    ends = [row(segment, u, order) for segment, u in ((0, 0.0), (count - 1, 1.0)) for order in (1, 2, 3)]
    wanted = points.new_zeros(len(passing) + len(smooth) + len(ends), points.shape[1])
    wanted[: len(passing)] = torch.stack([points[:-1], points[1:]], 1).flatten(0, 1)
    return torch.stack([*passing, *smooth, *ends]), wanted


def turning_points(path: Float[Tensor, "n c"], tolerance: float) -> Float[Tensor, "m c"]:
    """Few points of a path, both ends among them, with lines between them that come within `tolerance` of all of it.

    (Ramer, 1972; Douglas and Peucker, 1973.)
    """
    if len(path) <= 2:
        return path
    scaled = scale_headings(path)
    line = scaled[-1] - scaled[0]
    share = ((scaled - scaled[0]) @ line / line.square().sum().clamp_min(1e-12)).clamp(0, 1)
    distance = (scaled - scaled[0] - share[:, None] * line).norm(dim=-1)
    farthest = int(distance.argmax())
    if distance[farthest] <= tolerance:
        return path[[0, -1]]
    before, after = turning_points(path[: farthest + 1], tolerance), turning_points(path[farthest:], tolerance)
    return torch.cat([before[:-1], after])


def arrival_times(points: Float[Tensor, "knots c"], steps: int, dt: float) -> Float[Tensor, " knots"]:
    """Compute the times at which a robot that eases along the lines between points reaches each of them [s]."""
    reached = np.concatenate([[0.0], np.cumsum(lengths(points).double().numpy())])
    share = reached / max(reached[-1], 1e-12)
    time = np.interp(share, ease(steps).double().numpy(), np.arange(steps + 1) * dt)
    time[0], time[-1] = late_steps(steps) * dt, steps * dt
    return torch.from_numpy(time)
