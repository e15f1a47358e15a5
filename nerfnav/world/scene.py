"""A place as it really is: what is seen, what is touched, and what is asked of a robot there."""

from dataclasses import dataclass
from enum import Enum

import trimesh

from nerfnav.geometry import Box
from nerfnav.world.paint import Paint
from nerfnav.world.task import Task


class Vantage(Enum):
    """From where a place is seen."""

    ANYWHERE = "anywhere"
    """From wherever is free."""
    INSIDE = "inside"
    """A room: from where walls stand all around."""
    OUTSIDE = "outside"
    """Open ground: from where the sky is seen, and not from below the ground."""


@dataclass(frozen=True, eq=False)
class Scene:
    """Ground truth. Two scenes are the same only if they are the same object."""

    name: str
    """What users call it, as in `nerfnav plan NAME`."""
    title: str
    """What users read."""
    mesh: trimesh.Trimesh
    """What is seen: sRGB vertex colours, face colours or a UV texture, light and shadow included."""
    solids: tuple[trimesh.Trimesh, ...]
    """What is touched: watertight parts, which may overlap one another."""
    box: Box
    """Where a field of the scene lives and a robot may fly."""
    sky: tuple[float, float, float]
    """sRGB colour of a ray that hits nothing, in [0, 1]."""
    tasks: tuple[Task, ...]
    """Flights to try, the first of them the default."""
    voxel: float | None = None
    """Size of the voxels that suit a field of it [m]; None where the usual size does."""
    paint: Paint | None = None
    """The mesh's colours, where they are more than the mesh itself can hold."""
    sheets: tuple[trimesh.Trimesh, ...] = ()
    """What is touched but has no inside: walls without thickness, ground without depth."""
    vantage: Vantage = Vantage.ANYWHERE
    """From where it is photographed."""
