"""Alignment of a place by hand: its correction so far, with the steps before, and the commands that change it.

The page shows the place as the correction leaves it. Points, floor, crop box and gizmo are in these coordinates; each
of them changes the correction at once, by the code of `nerfnav place`.
"""

import math
from dataclasses import dataclass, replace
from enum import Enum

import torch

from nerfnav.geometry import Box, Pose, Similarity, so3
from nerfnav.importers import AlignmentRequest, Corners, MeasuredDistance, compute_alignment

Vector = tuple[float, float, float]
_IDENTITY = Similarity.identity().numbers
_STRAIGHT = math.radians(1.0)
"""Angle from a quarter turn below which a turn by hand becomes that: then no node of the field is resampled [rad]."""
_THINNEST = 0.01
"""Least edge of the crop box, in longest edges of the place."""


UNFINISHED = ("Not yet", "The place is being turned: apply or cancel that first.")
"""Title and text of the notice where something needs the place to stay."""


class PickTarget(Enum):
    """Measurement that clicks into the scene take; the value is the user's option."""

    FLOOR = "the floor"
    DISTANCE = "two points"

    @property
    def count(self) -> int:
        """Number of points that it takes."""
        return 2 if self is PickTarget.DISTANCE else 3


class Axis(Enum):
    """Axis of a quarter turn; the value is the user's option."""

    X = "x"
    Y = "y"
    Z = "z"


@dataclass(frozen=True)
class Ray:
    """Ray of a click into the scene."""

    origin: Vector
    """[m]"""
    direction: Vector
    """Of any length."""


@dataclass(frozen=True)
class Correction:
    """Correction of a place: a similarity transform, and the box to keep after it."""

    numbers: tuple[float, ...] = _IDENTITY
    """Transform from the place as it is, as `Similarity.numbers`."""
    crop: Corners | None = None
    """Lowest and highest corner of the part to keep [m]; None: all."""

    @property
    def similarity(self) -> Similarity:
        """Transform from the place as it is to where it is shown."""
        return Similarity.of_numbers(self.numbers)

    @property
    def is_moved(self) -> bool:
        """True where the place is turned, moved or scaled."""
        return self.numbers != _IDENTITY

    def request(self) -> AlignmentRequest:
        """Build the request of the importers."""
        return AlignmentRequest(moved=self.similarity if self.is_moved else None, box=self.crop)

    def aligned(self, request: AlignmentRequest, box: Box) -> "Correction":
        """Correct the place of `box` further by measurements. Raises InvalidInputError as `compute_alignment` does."""
        request = replace(request, moved=self.similarity)
        change = compute_alignment(request, box, torch.zeros(0, 3), torch.Generator().manual_seed(0)).similarity
        return self.placed(change)

    def placed(self, similarity: Similarity) -> "Correction":
        """Take another transform; the crop box becomes the smallest one around where it is then."""
        if self.crop is None:
            return Correction(similarity.numbers)
        crop = similarity.after(self.similarity.inverted()).box(Box.of(*self.crop))
        return Correction(similarity.numbers, (_vector(crop.lower), _vector(crop.upper)))

    def posed(self, rotation: torch.Tensor, position: Vector, box: Box) -> "Correction":
        """Turn the place of `box` to a rotation (3, 3), its middle at a position [m], and leave the crop box.

        Rotations that are nearly quarter turns become that.
        """
        whole = rotation.round()
        straight = torch.linalg.det(whole) > 0.5 and (rotation - whole).norm() < math.sqrt(2) * _STRAIGHT
        rotation, scale = whole if straight else rotation, self.similarity.scale
        middle = scale * (rotation @ box.center.double())
        return Correction(Similarity(rotation, torch.tensor(position).double() - middle, scale).numbers, self.crop)

    def turned(self, axis: Axis, box: Box) -> "Correction":
        """Turn the place of `box` by 90 degrees about an axis of the world through its middle."""
        along = torch.eye(3, dtype=torch.float64)[list(Axis).index(axis)]
        pose = self.pose(box)
        turned = self.posed(so3.exp(0.5 * math.pi * along) @ pose.rotation, _vector(pose.position), box)
        return self.placed(turned.similarity)

    def scaled(self, scale: float, box: Box) -> "Correction":
        """Scale the place of `box` about the origin. Raises InvalidInputError for scales that are not above 0."""
        return self.aligned(AlignmentRequest(scale=scale / self.similarity.scale), box)

    def box(self, box: Box) -> Box:
        """The smallest box around where the place of `box` is."""
        return self.similarity.box(box)

    def pose(self, box: Box) -> Pose:
        """Pose of the gizmo: the turned axes, in the middle of the place of `box`."""
        return Pose(self.similarity.rotation, self.similarity(box.center.double()))

    def ray_before(self, ray: Ray) -> Ray:
        """The ray in the place as it is."""
        back = self.similarity.inverted()
        along = back.rotation @ torch.tensor(ray.direction).double()
        return Ray(_vector(back(torch.tensor(ray.origin).double())), _vector(along))

    def pose_before(self, pose: Pose) -> Pose:
        """The pose of a camera that sees the same of the place as it is."""
        return self.similarity.inverted().pose(pose)

    def point_after(self, point: Vector) -> Vector:
        """The point [m] of the place as it is, where it is shown."""
        return _vector(self.similarity(torch.tensor(point).double()))


@dataclass(frozen=True)
class AlignmentDraft:
    """Correction of the open place that is not applied yet, and what the user is about to enter."""

    now: Correction = Correction()
    """The correction so far."""
    past: tuple[Correction, ...] = ()
    """The corrections before each step, the newest last."""
    by_hand: bool = False
    """True while the gizmo is shown."""
    held: bool = False
    """True while the user drags the gizmo or a face of the crop box."""
    pointing: PickTarget | None = None
    """Measurement that the next click takes; None: clicks measure nothing."""
    clicked: Ray | None = None
    """A click whose target is being computed."""
    picked: tuple[Vector, ...] = ()
    """Points of the measurement so far [m]."""
    finding: bool = False
    """True while the floor is searched."""
    undo: tuple[str, ...] = ()
    """Earlier fields, the newest last."""
    changes: tuple[str, ...] = ()
    """Description of the last alignment that was applied."""

    @property
    def is_shown(self) -> bool:
        """True while the page shows the box of the place and its corrections."""
        asked = self.by_hand or self.pointing is not None or bool(self.picked)
        return asked or self.now != Correction()

    @property
    def is_moving(self) -> bool:
        """True where the place is not where start, goal and plans are, or may leave it any time."""
        return self.by_hand or self.now.is_moved

    @property
    def length(self) -> float | None:
        """Present distance of the two points [m]."""
        return math.dist(*self.picked) if len(self.picked) == 2 and self.pointing is None else None

    def corrected(self, now: Correction, held: bool = False) -> "AlignmentDraft":
        """Take another correction as a step that can be undone; a hand that drags makes one step in all."""
        past = self.past if self.held or now == self.now else (*self.past, self.now)
        return replace(self, now=now, past=past, held=held)

    def pointed(self, point: Vector, box: Box) -> "AlignmentDraft":
        """Add a point; the third one of the floor levels the place of `box`.

        Raises InvalidInputError for points of the floor on one line.
        """
        assert self.pointing is not None, "only requested clicks measure something"
        picked = (*self.picked, point)
        if len(picked) < self.pointing.count:
            return replace(self, picked=picked)
        done = replace(self, picked=picked, pointing=None)
        if self.pointing is PickTarget.DISTANCE:
            return done
        floor = (picked[0], picked[1], picked[2])
        # the eye of the last click lies above the floor
        eye = point if self.clicked is None else self.clicked.origin
        x, y, z = (above - sum(side) / 3 for above, side in zip(eye, zip(*floor, strict=True), strict=True))
        return replace(done, picked=()).corrected(self.now.aligned(AlignmentRequest(floor=floor, up=(x, y, z)), box))

    def measured(self, distance: float, box: Box) -> "AlignmentDraft":
        """Scale the place of `box` so that the two points are so far apart [m].

        Raises InvalidInputError for points at one place.
        """
        assert self.length is not None, "two points are measured"
        measured = MeasuredDistance(self.picked[0], self.picked[1], distance)
        scaled = self.corrected(self.now.aligned(AlignmentRequest(measured), box))
        return replace(scaled, picked=tuple(_vector(measured.scale * torch.tensor(point)) for point in self.picked))

    def cropped(self, crop: Corners | None, box: Box, held: bool = False) -> "AlignmentDraft":
        """Keep a box of the place, with every edge above a least length."""
        if crop is not None:
            least = _THINNEST * float(self.now.box(box).size.max())
            lower, upper = crop
            x, y, z = (max(high, low + least) for low, high in zip(lower, upper, strict=True))
            crop = lower, (x, y, z)
        return self.corrected(replace(self.now, crop=crop), held)


def _vector(point: torch.Tensor) -> Vector:
    x, y, z = point.tolist()
    return x, y, z


@dataclass(frozen=True)
class PickPoints:
    """Let the next clicks into the scene take a measurement, from its first point on; None: clicks measure nothing."""

    pointing: PickTarget | None


@dataclass(frozen=True)
class SetDistance:
    """Set the true distance of the two points, which scales the place."""

    distance: float
    """[m]"""


@dataclass(frozen=True)
class SetScale:
    """Set the scale: metres of the corrected place in a metre of the place as it is."""

    scale: float


@dataclass(frozen=True)
class FindFloor:
    """Find the floor, and level the place by it."""


@dataclass(frozen=True)
class ShowGizmo:
    """Show or hide the gizmo that turns and moves the place."""

    on: bool


@dataclass(frozen=True)
class PosePlace:
    """Turn and move the place by its gizmo."""

    wxyz: tuple[float, float, float, float]
    """Attitude of the gizmo."""
    position: Vector
    """Position of the gizmo [m]."""
    held: bool = False
    """True while the user still drags it."""

    @property
    def rotation(self) -> torch.Tensor:
        """The attitude as a rotation (3, 3)."""
        return so3.matrix_from_quaternion(torch.tensor(self.wxyz, dtype=torch.float64))


@dataclass(frozen=True)
class QuarterTurn:
    """Turn the place by 90 degrees about an axis of the world through its middle."""

    axis: Axis


@dataclass(frozen=True)
class Crop:
    """Set the part of the place to keep; None: all."""

    box: Corners | None
    held: bool = False
    """True while the user still drags a face."""


@dataclass(frozen=True)
class TakePoint:
    """Take the point of the place that a click has met into the measurement."""

    point: Vector
    """Position at which it is shown [m]."""


CorrectionAction = PosePlace | QuarterTurn | SetScale | SetDistance | TakePoint | Crop
"""Change the correction."""


@dataclass(frozen=True)
class ApplyAlignment:
    """Correct the place by all that was entered."""


@dataclass(frozen=True)
class DiscardAlignment:
    """Discard all that was entered and not applied."""


@dataclass(frozen=True)
class UndoAlignment:
    """Undo the last step; without one, return to the place before the last alignment."""


AlignmentAction = (
    PickPoints | FindFloor | ShowGizmo | CorrectionAction | ApplyAlignment | DiscardAlignment | UndoAlignment
)
