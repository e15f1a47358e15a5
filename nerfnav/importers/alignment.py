"""Alignment: georeference a place by a measured length, a floor, an up direction and a crop box.

Notation: p' = s R p + t takes points of the place as it is to where they belong. s is the true distance of two points
over the one that they have. R turns up to z, by the smallest rotation. With a floor, t_z puts it at z = 0; x and y
keep their origin.
"""

import math
from dataclasses import dataclass

import torch
from jaxtyping import Float
from torch import Tensor

from nerfnav.core.errors import InvalidInputError
from nerfnav.geometry import Box, Similarity
from nerfnav.geometry.plane import Plane, RansacConfig, fit_plane, plane_through
from nerfnav.importers.core.placement import Vector, format_length, rotation_to_z

_LEVEL = 1e-4
"""Angle below which a floor counts as level already [rad]."""
_TOLERANCE = 0.005
"""Distance from a floor that is looked for at which points still lie on it, in longest edges of the place."""


@dataclass(frozen=True)
class AlignmentRequest:
    """What a person has measured and pointed at, in the coordinates of the place as it is; None: as it was."""

    measured: tuple[Vector, Vector, float] | None = None
    """Two points, and how far they are apart in truth [m]."""
    scale: float | None = None
    """How many metres a metre of before is: another way to say the same."""
    floor: tuple[Vector, Vector, Vector] | None = None
    """Three points on the floor."""
    find_floor: bool = False
    """Whether the floor is looked for instead."""
    up: Vector | None = None
    """A direction that is up; with a floor it only says on which side of that."""
    box: tuple[Vector, Vector] | None = None
    """Lowest and highest corner of what is kept, in the place as it is afterwards [m]."""
    kept: tuple[Vector, Vector] | None = None
    """The same in the place as it is: what is kept is the smallest box around that afterwards."""

    def __post_init__(self) -> None:
        """Raise InvalidInputError for what cannot be meant."""
        if self.measured is not None and self.scale is not None:
            raise InvalidInputError("give either a measured distance or a scale, not both")
        if self.floor is not None and self.find_floor:
            raise InvalidInputError("give three points of the floor or let it be found, not both")
        if self.box is not None and self.kept is not None:
            raise InvalidInputError("give one box, as the place is or as it will be, not both")
        self._check_scale()
        if self.up is not None and not 0 < math.hypot(*self.up) < math.inf:
            raise InvalidInputError("up must be a direction of three finite numbers, not all of them 0")
        if self.floor is not None:
            plane_through(torch.tensor(self.floor))
        for box in (self.box, self.kept):
            if box is not None and not all(low < high for low, high in zip(*box, strict=True)):
                raise InvalidInputError("a box is its lowest corner and then its highest corner, each number above")

    def _check_scale(self) -> None:
        for name, value in (("scale", self.scale), ("distance", self.measured and self.measured[2])):
            if value is not None and not 0 < value < math.inf:
                raise InvalidInputError(f"the {name} must be a number above 0, not {value:g}")
        if self.measured is not None and math.dist(*self.measured[:2]) == 0:
            raise InvalidInputError("the two measured points are the same: their distance tells no scale")

    @property
    def is_empty(self) -> bool:
        """Whether nothing is to be changed."""
        return self == AlignmentRequest()

    @property
    def factor(self) -> float | None:
        """How many metres a metre of before is; None where nobody said."""
        if self.measured is None:
            return self.scale
        first, second, distance = self.measured
        return distance / math.dist(first, second)


@dataclass(frozen=True)
class Alignment:
    """What a correction comes to."""

    similarity: Similarity
    """From the place as it is to where it belongs."""
    box: Box | None
    """What is kept afterwards; None: all."""
    told: tuple[str, ...]
    """What changes, and what was guessed for it: sentences for the user."""


def compute_alignment(
    correction: AlignmentRequest, box: Box, surface: Float[Tensor, "n 3"], generator: torch.Generator
) -> Alignment:
    """What a correction means for a place of `box`, of whose surface some points [m] are known.

    Raises InvalidInputError where no floor is found.
    """
    told: list[str] = []
    factor = correction.factor
    if factor is not None:
        longest = format_length(factor * float(box.size.max()))
        told.append(f"a metre of before is {factor:.4g} m now, and the place is {longest} long")
    rotation, height = torch.eye(3, dtype=torch.float64), 0.0
    floor = _floor(correction, box, surface, generator)
    if floor is not None:
        rotation, height = _turn(floor.normal), (factor or 1.0) * floor.offset
        told.append(f"{_tilt(rotation)}; the floor is at z = 0 now, and was {floor.offset:.3g} m from the origin")
        if correction.floor is not None and correction.up is None:
            told.append("up is the side of the floor on which most of the place is (guessed; --up says which)")
    elif correction.up is not None:
        rotation = _turn(torch.tensor(correction.up).double())
        told.append(_tilt(rotation))
    translation = torch.tensor([0.0, 0.0, -height], dtype=torch.float64)
    similarity = Similarity(rotation, translation, factor or 1.0)
    kept = None if correction.box is None else Box.of(*correction.box)
    if correction.kept is not None:
        kept = similarity.box(Box.of(*correction.kept))
    return Alignment(similarity, kept, tuple(told))


def _floor(
    correction: AlignmentRequest, box: Box, surface: Float[Tensor, "n 3"], generator: torch.Generator
) -> Plane | None:
    """The floor, its normal upwards; None where nothing was said of it."""
    if correction.floor is not None:
        plane = plane_through(torch.tensor(correction.floor))
        if correction.up is not None:
            return plane.facing(torch.tensor(correction.up))
        middle = surface.mean(0) if len(surface) else box.center
        return plane if float(plane.heights(middle)) >= 0 else Plane(-plane.normal, -plane.offset)
    if not correction.find_floor:
        return None
    up = torch.tensor(correction.up or (0.0, 0.0, 1.0))
    tolerance = _TOLERANCE * float(box.size.max())
    found = fit_plane(surface, up, generator, RansacConfig(tolerance=tolerance))
    if found is None:
        raise InvalidInputError(
            "no floor was found: no level plane has much of the place on it and next to nothing below; point at three "
            "points of the floor"
        )
    return found


def _turn(up: Float[Tensor, "3"]) -> Float[Tensor, "3 3"]:
    """The smallest rotation that takes a direction to z; quarter turns and no turn at all without rounding."""
    rotation = torch.from_numpy(rotation_to_z(up.numpy()))
    whole = rotation.round()
    return whole if (rotation - whole).abs().max() < _LEVEL else rotation


def _tilt(rotation: Float[Tensor, "3 3"]) -> str:
    angle = math.degrees(math.acos(max(-1.0, min(1.0, float(rotation[2, 2])))))
    return "up was right already" if angle == 0 else f"up was {angle:.3g} degrees off, and is z now"
