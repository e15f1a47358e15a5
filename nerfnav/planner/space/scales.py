"""Scales of planning: lengths that follow from how finely the place is known and from how large the robot is.

Lengths for the paper's robot, 10 cm wide, in its place of two metres with voxels of 13 mm suit no hall and no doll's
house. Every length on a map, and every density on it, follows from three: the width w of the body, the
distance h of the field's nodes, and the volume V of its box. For the paper's robot in the bundled worlds the rules give
what was chosen there by hand: voxels of 4 cm, a clearance of 10 cm, and so on.
"""

import math
from dataclasses import dataclass
from functools import cached_property

from jaxtyping import Int
from torch import Tensor

from nerfnav.field import SOLID_DENSITY, Field, GridField
from nerfnav.field.core.occupancy import PAPERS_GRAIN
from nerfnav.robots import Body, Motion, RigidState, interpolate_poses

_MOST_VOXELS = 24_000_000
"""Largest number of voxels of a map: a gigabyte during a search."""
_PAPERS_VOXEL = 0.04
"""Voxels of maps are no larger in such places [m]."""
_SHARE_OF_WIDTH = 0.4
_NODES_IN_VOXEL = 3.2
_OF_A_POINT = 0.1
"""Length and width of a body that has none [m]: those of the paper's robot."""
_HITS = 0.6
"""Optical depth of a body in what counts as solid: it would be hit with a chance of 45 %."""


@dataclass(frozen=True)
class Scales:
    """Lengths [m] and densities [1/m] of one robot in one place."""

    width: float
    """w: the shorter edge of the body's outline [m]."""
    length: float
    """The longer one [m]."""
    voxel: float
    """Distance of the map's voxels [m]: 0.4 w, so that a gap of 1.6 w is found wherever it lies between them. At most
    3.2 h, for a map may be as fine as costs nothing where the place is small for the robot; at least h, for a finer one
    shows nothing more; and so large that the box has no more of them than memory and patience allow."""
    threshold: float
    """Density above which a place counts as solid [1/m]: 5 / m in places of the paper's scale, h <= 17 mm, and less in
    larger ones, 5 / m (17 mm / h), as the density of a wall one voxel thick is. At most 0.6 / w: a body in there would
    be hit with a chance of 45 %."""

    @property
    def clearance(self) -> float:
        """Distance to solid space beyond which a path has no reason to keep off further: 2.5 voxels."""
        return 2.5 * self.voxel

    @property
    def headings(self) -> int:
        """Headings over half a turn of a body longer than wide: from one to the next its ends move 1.5 voxels."""
        return max(4, math.ceil(0.5 * math.pi * self.length / (1.5 * self.voxel) - 1e-6))

    @property
    def snap(self) -> float:
        """Largest distance from an end at which a search may begin: 3 w, and two voxels where these are large."""
        return max(3 * self.width, 2 * self.voxel)

    @property
    def search(self) -> float:
        """Distance from an occupied end within which a free point is searched: 10 w, and five voxels where these are
        large."""
        return max(10 * self.width, 5 * self.voxel)

    @property
    def rounding(self) -> float:
        """Length over which the corners of a path are rounded, and by which turning points may miss it: 1.5 voxels."""
        return 1.5 * self.voxel

    @property
    def turn(self) -> float:
        """Distance that a radian of turning counts for: half of a body that must turn at all."""
        return 0.5 * self.length

    @property
    def berth(self) -> float:
        """Distance around a path within which the next one costs more: 4 voxels."""
        return 4 * self.voxel

    @property
    def path_step(self) -> float:
        """Distance of points along a smoothed path: a quarter of a voxel."""
        return 0.25 * self.voxel

    @property
    def reach(self) -> float:
        """Distance around a plan within which solid space is searched: 5 w."""
        return 5 * self.width

    @property
    def drift(self) -> float:
        """Largest distance from the goal at which a plan that is continued may end: half a body's width."""
        return 0.5 * self.width

    @cached_property
    def decimals(self) -> int:
        """Decimals of positions for users: of paths' points [m], two for the paper's robot."""
        return max(0, math.ceil(-math.log10(self.path_step) - 1e-6))


def scales_of(field: Field, body: Body, voxel: float | None = None, threshold: float | None = None) -> Scales:
    """Compute the scales of a robot's body in a field; a voxel [m] or threshold [1/m] that is given is taken as it
    is."""
    length, width = (edge or _OF_A_POINT for edge in (max(body.extents[:2]), min(body.extents[:2])))
    grain, wanted = grain_of(field), _SHARE_OF_WIDTH * width
    if grain is not None:
        wanted = max(grain, min(wanted, _NODES_IN_VOXEL * grain, _PAPERS_VOXEL if grain <= PAPERS_GRAIN else math.inf))
    volume = field.box.size.double().prod().item()
    wanted = max(wanted, (volume / _MOST_VOXELS) ** (1 / 3))
    return Scales(width, length, voxel or wanted, threshold_of(field, width) if threshold is None else threshold)


def poses_along(field: Field, motion: Motion, body: Body) -> tuple[RigidState, Int[Tensor, " n"]]:
    """Interpolate the states of one motion so that each point of the body moves by at most half a voxel of maps from
    one to the next, in each of place and turn; return them with the indices of the given states among them.

    A robot at 3 m/s moves by 30 cm from one way point to the next, and at 9 rad/s its corners move on arcs.
    """
    spacing = 0.5 * scales_of(field, body).voxel
    return interpolate_poses(motion.states.detach(), spacing, spacing / max(body.radius, spacing))


def threshold_of(field: Field, width: float | None = None) -> float:
    """Compute the density above which a place counts as solid [1/m], for a body of a width [m] or any body; see
    Scales."""
    solid = field.solid_density if isinstance(field, GridField) else SOLID_DENSITY
    return solid if width is None else min(solid, _HITS / width)


def grain_of(field: Field) -> float | None:
    """Return the resolution of a field [m]; None where it has none."""
    if isinstance(field, GridField):
        return field.resolution
    step = getattr(field, "step", None)  # of networks: half of their resolution
    return None if step is None else 2 * float(step)


