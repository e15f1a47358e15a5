"""Alignment: georeference a place by hand, by a measured length, a floor, an up direction and a crop box.

Notation: p' = s R p + t takes points of the place as it is to where they belong. s is the true distance of two points
over the one that they have. R turns up to z, by the smallest rotation. With a floor, t_z puts it at z = 0; x and y
keep their origin. A transform that was set by hand comes first: the rest is measured in the place as it leaves it.
"""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError, require_positive
from nerfnav.geometry import Box, Similarity, so3
from nerfnav.geometry.plane import Plane, RansacConfig, fit_plane, plane_through
from nerfnav.importers.core.placement import (
    MeasuredDistance,
    Vector,
    format_length,
    require_box,
    require_direction,
    rotation_to_z,
)

_LEVEL = 1e-4
"""Angle below which a floor counts as level already [rad]."""
_TOLERANCE = 0.005
"""Largest distance of an inlier from the fitted floor, in longest edges of the place."""


@dataclass(frozen=True)
class AlignmentRequest:
    """Measurements and choices of a user, in the coordinates of the place; None: keep."""

    measured: MeasuredDistance | None = None
    """Two points and their true distance."""
    scale: float | None = None
    """New metres per old metre; an alternative to `measured`."""
    floor: tuple[Vector, Vector, Vector] | None = None
    """Three points on the floor."""
    find_floor: bool = False
    """Fit the floor to the surface."""
    up: Vector | None = None
    """Up direction; with a floor it only selects the side of that."""
    box: tuple[Vector, Vector] | None = None
    """Lowest and highest corner of what is kept, in the place as it is afterwards [m]."""
    moved: Similarity | None = None
    """Transform set by hand; all else is in the coordinates after it."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for contradictory or impossible requests."""
        if self.measured is not None and self.scale is not None:
            raise InvalidInputError("give either a measured distance or a scale, not both")
        if self.floor is not None and self.find_floor:
            raise InvalidInputError("give three points of the floor or let it be found, not both")
        require_positive(**{"the scale": self.scale})
        require_direction(self.up)
        if self.floor is not None:
            plane_through(torch.tensor(self.floor))
        require_box(self.box)

    @property
    def is_empty(self) -> bool:
        """True where nothing is to be changed."""
        return self == AlignmentRequest()

    @property
    def answered(self) -> tuple[str, ...]:
        """Guesses about the place that the request answers: those of its box were in the coordinates of before."""
        moved = self.moved or Similarity.identity()
        turned = not torch.equal(moved.rotation, Similarity.identity().rotation)
        answers = {
            "box": True,
            "up": turned or self.up is not None or self.floor is not None or self.find_floor,
            "scale": moved.scale != 1 or self.factor is not None,
        }
        return tuple(guess for guess, answered in answers.items() if answered)

    @property
    def factor(self) -> float | None:
        """New metres per old metre; None where neither a distance nor a scale is given."""
        return self.scale if self.measured is None else self.measured.scale


@dataclass(frozen=True)
class Alignment:
    """Alignment: the similarity transform and crop box that follow from a request."""

    similarity: Similarity
    """From the place as it is to where it belongs."""
    box: Box | None
    """Crop box after the transform; None: keep everything."""
    changes: tuple[str, ...]
    """Changes and guesses, as sentences for the user."""


def compute_alignment(
    request: AlignmentRequest, box: Box, surface: Float[Tensor, "n 3"], generator: torch.Generator
) -> Alignment:
    """Compute the alignment of a place of `box` from the request and points on its surface [m].

    Raises InvalidInputError where no floor is found.
    """
    changes: list[str] = []
    moved, factor = request.moved, request.factor
    if moved is not None:
        changes += _describe_move(moved, box)
        box, surface = moved.box(box), moved(surface)
    if factor is not None:
        changes.append(_scaled(factor, box))
    rotation, height = torch.eye(3, dtype=torch.float64), 0.0
    floor = _floor(request, box, surface, generator)
    if floor is not None:
        rotation, height = _turn(floor.normal), (factor or 1.0) * floor.offset
        changes.append(f"{_tilt(rotation)}; the floor is at z = 0 now, and was {floor.offset:.3g} m from the origin")
        if request.floor is not None and request.up is None:
            changes.append("up is the side of the floor on which most of the place is (guessed; --up says which)")
    elif request.up is not None:
        rotation = _turn(torch.tensor(request.up).double())
        changes.append(_tilt(rotation))
    similarity = Similarity(rotation, torch.tensor([0.0, 0.0, -height], dtype=torch.float64), factor or 1.0)
    similarity = similarity if moved is None else similarity.after(moved)
    return Alignment(similarity, None if request.box is None else Box.of(*request.box), tuple(changes))


def _floor(
    request: AlignmentRequest, box: Box, surface: Float[Tensor, "n 3"], generator: torch.Generator
) -> Plane | None:
    """Floor with its normal upwards; None where none is requested."""
    if request.floor is not None:
        plane = plane_through(torch.tensor(request.floor))
        if request.up is not None:
            return plane.facing(torch.tensor(request.up))
        middle = surface.mean(0) if len(surface) else box.center
        return plane if float(plane.heights(middle)) >= 0 else Plane(-plane.normal, -plane.offset)
    if not request.find_floor:
        return None
    config = RansacConfig(tolerance=_TOLERANCE * float(box.size.max()))
    found = fit_plane(surface, torch.tensor(request.up or (0.0, 0.0, 1.0)), generator, config)
    if found is None:
        raise InvalidInputError(
            "no floor was found: no level plane has much of the place on it and next to nothing below; point at three "
            "points of the floor"
        )
    return found


def turn_about_axes(degrees: Vector) -> Similarity:
    """Turn about the x axis, then y, then z of the world, through the origin, by angles [degrees]."""
    angles = torch.tensor(degrees, dtype=torch.float64).deg2rad()
    return Similarity(_exact(so3.from_roll_pitch_yaw(angles)), torch.zeros(3, dtype=torch.float64), 1.0)


def _turn(up: Float[Tensor, "3"]) -> Float[Tensor, "3 3"]:
    """The smallest rotation that takes a direction to z."""
    return _exact(torch.from_numpy(rotation_to_z(up.numpy())))


def _exact(rotation: Float[Tensor, "3 3"]) -> Float[Tensor, "3 3"]:
    """The rotation; quarter turns and no turn at all without rounding."""
    whole = rotation.round()
    return whole if (rotation - whole).abs().max() < _LEVEL else rotation


def _describe_move(moved: Similarity, box: Box) -> list[str]:
    """Describe a transform set by hand: scale, turn, and how far the middle of the place moves."""
    angle = math.degrees(math.acos(max(-1.0, min(1.0, (float(moved.rotation.trace()) - 1) / 2))))
    apart = float((moved(box.center) - box.center).norm())
    texts = [_scaled(moved.scale, box)] if moved.scale != 1 else []
    texts += [f"turned by {angle:.3g} degrees"] if angle > math.degrees(_LEVEL) else []
    return texts or [f"moved by {format_length(apart)}"]


def _scaled(factor: float, box: Box) -> str:
    longest = format_length(factor * float(box.size.max()))
    return f"a metre of before is {factor:.4g} m now, and the place is {longest} long"


def _tilt(rotation: Float[Tensor, "3 3"]) -> str:
    angle = math.degrees(math.acos(max(-1.0, min(1.0, float(rotation[2, 2])))))
    return "up was right already" if angle == 0 else f"up was {angle:.3g} degrees off, and is z now"
