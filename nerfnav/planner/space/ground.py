"""Ground support: the floor that carries a robot on the ground, and the height at which it stands there.

The floor is the first surface below the robot in the field as it was learned: what lies under that surface may be
unproven. It must carry nearly the whole footprint, and be as level as the field resolves. A robot stands some voxels
above it, for the haze on a surface counts as solid. On its way it has floor below it too: see `close_holes`.
"""

import math
from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
import torch
from jaxtyping import Float

from nerfnav.field import Field, VoxelField
from nerfnav.field.core.occupancy import SOLID_RAW, raw_of
from nerfnav.planner.space.ends import fits
from nerfnav.planner.space.occupancy import dense_at
from nerfnav.planner.space.regions import GAPS
from nerfnav.planner.space.scales import grain_of, scales_of
from nerfnav.robots import RigidState, Robot
from nerfnav.robots.ground import LEVEL, heading

_HAZE = 0.5
"""Least distance of the underside from the floor, beyond one of the gaps [voxels]."""
_STANDING = 3.5
"""Largest distance of the underside from the floor on which a robot stands [voxels]."""
_HIGHEST = 4.5
"""The same where it fits no lower, or where the other end needs it."""
_UNEVEN = 3.0
"""Largest difference of a spot of floor from its median height [voxels]: that of a floor learned from photographs."""
_CARRIED = 0.95
"""Least share of the footprint above level floor."""
_SPOTS = 17
"""Largest number of spots along each edge of the footprint."""
_STEPS = 240
"""Voxels along the longest edge of the box of a field that has none."""
_TOUCHING = 1e-5
"""Distance that rounding may give two heights that are one [m]."""


class Footing(Enum):
    """Footing of a robot on the ground at an end; the value is what follows the end's name."""

    STANDS = "stands on the floor"
    MOVED = "was put on the floor"
    NOT_JUDGED = "is outside of the field or in occupied space"
    IN_THE_AIR = "is in the air"
    ON_AN_EDGE = "is above an edge"
    OTHER_LEVEL = "is on another level than the start"

    @property
    def is_refused(self) -> bool:
        """True where no floor carries the robot. `check_ends` refuses what is not judged here."""
        return self in (Footing.IN_THE_AIR, Footing.ON_AN_EDGE, Footing.OTHER_LEVEL)

    @property
    def is_carried(self) -> bool:
        """True where a floor carries the robot."""
        return self in (Footing.STANDS, Footing.MOVED)


@dataclass(frozen=True)
class Support:
    """Support of a robot at an end."""

    state: RigidState
    """The state on the floor; the given one, to the bit, unless the footing is MOVED."""
    footing: Footing
    floor: float
    """Height of the floor below it [m]; NaN without one."""
    depth: float
    """Height below the underside that was searched [m]."""
    share: float
    """Share of the footprint above level floor."""
    other: float = math.nan
    """Height of the floor at the start [m], where the goal is on another level."""

    def problem(self, robot: str, end: str) -> str | None:
        """Explain in one sentence why a robot cannot stand at the named end, with the remedy; None where it can."""
        match self.footing:
            case Footing.IN_THE_AIR:
                return (
                    f"the {robot} would stand in the air at the {end}: there is no floor within {self.depth:.2g} m "
                    f"below it; move the {end} onto the floor"
                )
            case Footing.ON_AN_EDGE:
                return (
                    f"the {robot} would not stand level at the {end}: the floor carries {100 * self.share:.0f} % of "
                    f"its footprint; move the {end} onto level floor"
                )
            case Footing.OTHER_LEVEL:
                return (
                    f"the {robot} stays on one level: the floor at the {end} is at {self.floor:.2f} m, and that at the "
                    f"start at {self.other:.2f} m; move one of them"
                )
        return None


def settle_on_ground(matter: Field, field: Field, robot: Robot, state: RigidState) -> Support:
    """Put a robot on the floor below it, or say why it cannot stand there.

    `matter` is the field as it was learned, `field` the one to plan in. A state that stands already stays as it is.
    One with its underside in the floor is raised, by at most half of its height.
    """
    return _Ground.of(matter, field, robot).settle(state)


def settle_ends(
    matter: Field, field: Field, robot: Robot, start: RigidState, goal: RigidState
) -> tuple[Support, Support]:
    """Put start and goal of a robot on the floor, at one height; those of a robot that flies stay as they are.

    The goal is on OTHER_LEVEL where no height suits both.
    """
    if not robot.planar:
        return _flying(start), _flying(goal)
    ground = _Ground.of(matter, field, robot)
    supports = ground.settle(start), ground.settle(goal)
    heights = [support.state.position[2].item() for support in supports]
    if not all(support.footing.is_carried for support in supports) or abs(heights[0] - heights[1]) <= LEVEL:
        return supports
    # an end that stands already keeps its height, if it can
    for support in sorted(supports, key=lambda support: support.footing is not Footing.STANDS):
        height = support.state.position[2].item()
        if all(ground.stands_at(each, height) for each in supports):
            first, last = (ground.lifted(each, height) for each in supports)
            return first, last
    first, last = supports
    return first, replace(last, state=goal, footing=Footing.OTHER_LEVEL, other=first.floor)


@torch.no_grad()
def close_holes(field: Field, robot: Robot, height: float) -> Field:
    """Fill holes of the floor over the height of a robot that drives with its middle at a height [m].

    `field` is the one to plan in: where it has nothing solid within a step below the robot, nor the bottom of its box,
    the robot would fall, and the field returned is solid. It is the given one for robots that fly, for a floor without
    holes, and for fields that are no dense grid, of which the ends alone are judged.
    """
    if not robot.planar or not isinstance(field, VoxelField):
        return field
    half, border = 0.5 * robot.body.extents[2], float(field.box.lower[2])
    rise = float(field.spacing[2])
    bottom = height - half - border
    if bottom <= _STANDING * rise:
        return field
    raw = field.values[..., 0]
    first, last = (max(0, math.floor(level / rise)) for level in (bottom - (_HIGHEST + _UNEVEN) * rise, bottom))
    solid = (raw[..., first : last + 1] > raw_of(scales_of(field, robot.body).threshold)).any(-1)
    # the edge of a hole carries as much of a robot as an end may have beyond it; a node alone is none
    hole = torch.nn.functional.max_pool2d(solid[None].float(), 3, stride=1, padding=1)[0] == 0
    if not bool(hole.any()):
        return field
    values, top = field.values.clone(), math.ceil((bottom + 2 * half) / rise)
    values[..., 0][hole, last : top + 1] = SOLID_RAW
    return replace(field, values=values)


def _flying(state: RigidState) -> Support:
    return Support(state, Footing.NOT_JUDGED, math.nan, 0.0, 1.0)


@dataclass(frozen=True)
class _Ground:
    """Ground of a field below one robot."""

    matter: Field
    field: Field
    robot: Robot
    grain: float
    """Edge of the field's voxels [m]."""
    threshold: float
    """Density above which a place counts as solid [1/m]."""

    @classmethod
    def of(cls, matter: Field, field: Field, robot: Robot) -> "_Ground":
        grain = grain_of(matter) or float(matter.box.size.max()) / _STEPS
        return cls(matter, field, robot, grain, scales_of(field, robot.body).threshold)

    @property
    def half(self) -> float:
        """Half of the robot's height [m]."""
        return 0.5 * self.robot.body.extents[2]

    def settle(self, state: RigidState) -> Support:
        middle, box = state.position[2].item(), self.field.box.to("cpu")
        finite = bool(torch.isfinite(state.position).all() and torch.isfinite(state.rotation).all())
        if not finite or not box.contains(state.position.cpu()):
            return Support(state, Footing.NOT_JUDGED, math.nan, 0.0, 0.0)
        bottom, lowest = middle - self.half, float(box.lower[2])
        reach = (_HIGHEST + _UNEVEN) * self.grain
        near = self._support(state, self._tops(state, bottom, reach), bottom - lowest)
        if near.share >= _CARRIED and _TOUCHING < bottom - near.floor <= _STANDING * self.grain:
            return replace(near, footing=Footing.STANDS)
        below = self._support(state, self._tops(state, middle), bottom - lowest)
        if math.isnan(below.floor):
            return replace(below, footing=Footing.IN_THE_AIR)
        if below.floor >= middle - _TOUCHING:
            return replace(below, footing=Footing.NOT_JUDGED)
        if below.share < _CARRIED:
            raised = below.floor >= bottom  # it is in something, which `check_ends` says better
            return replace(below, footing=Footing.NOT_JUDGED if raised else Footing.ON_AN_EDGE)
        return self._put_on(below, middle)

    def stands_at(self, support: Support, height: float) -> bool:
        """Check that a robot can stand above a floor with its middle at a height [m]."""
        if abs(support.state.position[2].item() - height) <= LEVEL:
            return True
        gap = height - self.half - support.floor
        return 0 < gap <= _HIGHEST * self.grain and self._fits(_at_height(support.state, height))

    def lifted(self, support: Support, height: float) -> Support:
        """Put a supported state at a height [m]."""
        if support.state.position[2].item() == height:
            return support
        return replace(support, state=_at_height(support.state, height), footing=Footing.MOVED)

    def _put_on(self, below: Support, middle: float) -> Support:
        """Put a robot on the floor below it, as near as it fits; where it fits nowhere above, its end is occupied."""
        bottom = middle - self.half
        heights = [round(below.floor + (gap + _HAZE) * self.grain + self.half, 3) for gap in GAPS]
        states = [_at_height(below.state, height) for height in heights]
        found = next((state for state in states if self._fits(state)), None)
        if found is None and below.floor >= bottom:
            return replace(below, footing=Footing.NOT_JUDGED)
        found = states[0] if found is None else found
        lowered = middle - found.position[2].item()
        if below.floor < bottom and 0 <= lowered < self.grain:  # less than the floor is known to
            return replace(below, footing=Footing.STANDS)
        return replace(below, state=found, footing=Footing.MOVED)

    def _fits(self, state: RigidState) -> bool:
        return fits(self.field, self.robot.body, state, self.threshold)

    def _support(self, state: RigidState, tops: Float[np.ndarray, " spots"], depth: float) -> Support:
        """Measure the floor that the spots of a footprint have below them; its footing is to be judged."""
        found = tops[np.isfinite(tops)]
        floor = float(np.quantile(found, 0.5, method="higher")) if len(found) else math.nan
        level = np.abs(tops - floor) <= _UNEVEN * self.grain
        return Support(state, Footing.NOT_JUDGED, floor, max(0.0, depth), float(level.mean()))

    def _tops(self, state: RigidState, above: float, reach: float = math.inf) -> Float[np.ndarray, " spots"]:
        """Find the first solid height from `above` down to `reach` below it [m] at each spot of the footprint; NaN
        without.

        A box may be cropped at the floor: its bottom, below which planners take all for solid, is floor at the other
        spots too where some of them have the floor there, and right below the robot where none has any.
        """
        border = float(self.field.box.lower[2])
        lowest, spots = max(border, above - reach), self._spots(state)
        count = max(2, math.ceil((above - lowest) / (0.5 * self.grain)) + 1)
        z = torch.linspace(above, lowest, count)
        points = torch.cat([spots[:, None].expand(-1, count, 2), z.expand(len(spots), count)[..., None]], -1)
        solid = dense_at(self.matter, points, self.threshold).numpy().astype(bool)
        tops = np.where(solid.any(-1), z.numpy()[solid.argmax(-1)], np.nan)
        found = tops[np.isfinite(tops)]
        gap = state.position[2].item() - self.half - border
        cropped = np.median(found) - border <= self.grain if len(found) else gap <= _STANDING * self.grain
        return np.where(np.isnan(tops), border, tops) if cropped else tops

    def _spots(self, state: RigidState) -> Float[torch.Tensor, "spots 2"]:
        """Spread spots about a voxel apart over the footprint, its edges included."""
        length, width, _ = self.robot.body.extents
        along, across = (
            torch.linspace(-0.5 * edge, 0.5 * edge, min(_SPOTS, max(3, math.ceil(edge / self.grain) + 1)))
            for edge in (length, width)
        )
        yaw = heading(state).item()
        turn = torch.tensor([[math.cos(yaw), math.sin(yaw)], [-math.sin(yaw), math.cos(yaw)]])
        return torch.cartesian_prod(along, across) @ turn + state.position[:2].cpu().float()


def _at_height(state: RigidState, height: float) -> RigidState:
    position = state.position.clone()
    position[2] = height
    return replace(state, position=position)
