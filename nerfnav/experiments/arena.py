"""Where experiments happen."""

from dataclasses import dataclass

from nerfnav.field import VoxelField
from nerfnav.world import Scene


@dataclass(frozen=True, eq=False)
class Arena:
    """A world as it is and as it was learned: plan in one, judge on the other."""

    scene: Scene
    """The ground truth."""
    field: VoxelField
    """What was trained from its pictures."""
