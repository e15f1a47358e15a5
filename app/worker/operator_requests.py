"""Kidnapped robot: where a flying robot is put down without being told."""

import torch

from nerfnav.field import Unknown
from nerfnav.geometry import Pose
from nerfnav.navigation.carrying import carried_away
from nerfnav.planner import fits
from nerfnav.robots import RigidState
from nerfnav_app.places.derived import planning_place
from nerfnav_app.places.place import Place

_ROOM = 0.03
"""Around a robot that is put down somewhere else [m]."""


def elsewhere(place: Place, truth: RigidState, generator: torch.Generator) -> Pose | None:
    """A pose at which the robot fits, far from where it is; None where there is none."""
    seen = planning_place(place, Unknown.OCCUPIED)  # as plans see it
    body = seen.robot.body_with_room(_ROOM)

    def fits_there(state: RigidState) -> bool:
        return fits(seen.field, body, seen.robot.settled(state, truth))

    return carried_away(truth, seen.field.box, fits_there, generator)
