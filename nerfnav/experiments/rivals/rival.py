"""Rival: records of the planners that are compared, and what all of them are given.

All plan in the same trained field, its unproven space solid: nerfnav and minimum snap in the field itself, trees around
its surface (marching cubes), planners of point clouds around points of that surface.
"""

import importlib
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import trimesh
from jaxtyping import Float, Float32

from nerfnav.core.extras import installed_version
from nerfnav.experiments.arena import Arena, per_arena
from nerfnav.experiments.planners import ROBOT
from nerfnav.field import UnknownSpace, planning_field
from nerfnav.planner import PlanProblem, RRTConfig
from nerfnav.planner.baselines.rrt import search_mesh
from nerfnav.robots import Motion

POINTS_M = 0.02
"""Largest edge between neighbouring points of the surface [m]: half of the robot's height."""


@dataclass(frozen=True)
class Answer:
    """Answer of a planner to one pair of ends."""

    ms: float
    """Time that it took [ms], without what is made once for a place."""
    path: Float[np.ndarray, "n 3"] | None = None
    """Positions from start to goal [m]; None: not solved."""
    motion: Motion | None = None
    """Its own motion over the time steps of the problem; None where it has no times."""
    reason: str = ""
    """Reason why there is no path, in its own words."""


Plan = Callable[[PlanProblem, int], Answer]
"""Plan between the ends of a problem; the number seeds what is random."""


@dataclass(frozen=True)
class Rival:
    """Planner in the comparison, with what a reader must know about it."""

    name: str
    """Name in the table."""
    prepare: Callable[[Arena], Plan]
    """Makes what is made once for a place."""
    missing: Callable[[], str | None]
    """Reason why it cannot run here, and the remedy; None where it can."""
    version: Callable[[], str]
    """Version of its library."""
    options: str
    """Options and input that it gets."""
    omits: str
    """Limits: what it leaves out."""


def explain_missing(package: str, module: str, remedy: str) -> str | None:
    """Reason why a package of others cannot be used; None where it can. Imports it only where it is installed."""
    if installed_version(package) is None:
        return f"not installed: {remedy}"
    try:
        importlib.import_module(module)
    except ImportError as error:
        return f"installed, but it cannot be imported: {error}"
    return None


@per_arena
def make_planning_arena(arena: Arena) -> Arena:
    """The same place with the field to plan in: unproven space is solid, as for flights."""
    return replace(arena, field=planning_field(arena.field, UnknownSpace.OCCUPIED))


@per_arena
def make_search_mesh(arena: Arena) -> trimesh.Trimesh:
    """Surface of the field to plan in."""
    return search_mesh(make_planning_arena(arena).field, ROBOT, RRTConfig())


@per_arena
def sample_surface(arena: Arena) -> Float32[np.ndarray, "n 3"]:
    """Points of that surface [m], no more than POINTS_M along an edge apart."""
    mesh = make_search_mesh(arena)
    points = trimesh.remesh.subdivide_to_size(mesh.vertices, mesh.faces, POINTS_M)[0]
    return np.asarray(points, np.float32)
