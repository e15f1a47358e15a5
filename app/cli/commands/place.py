"""nerfnav place: georeference a field by hand, without training again."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional

from nerfnav.importers import AlignmentRequest, turn_about_axes
from nerfnav_app.cli.arguments import Corners, Up, measured_distance, numbers_argument, vector
from nerfnav_app.cli.progress import run_and_print
from nerfnav_app.cli.terminal import Output
from nerfnav_app.jobs.field.georeference import PlaceRequest
from nerfnav_app.jobs.field.georeference import run as run_job

Measured = Annotated[tuple[float, ...] | None, numbers_argument("measure", "X Y Z X Y Z DISTANCE")]
Turn = Annotated[tuple[float, ...] | None, numbers_argument("turn", "X Y Z")]
Floor = Annotated[tuple[float, ...] | None, numbers_argument("floor", "X Y Z X Y Z X Y Z")]


@dataclass(frozen=True)
class Arguments(Output):
    """Turn a field, set its scale and its floor, and crop it, without training it again.

    Points are in the present coordinates of the field, after --turn; numbers may be separated by commas. The floor
    comes to z = 0. Guesses and changes are printed.
    """

    field: Positional[str]
    """Path of a field file, or name of a bundled scene."""
    out: Path
    """File for the new field, another one than FIELD. Splats and ground truth are kept beside it."""
    turn: Turn = None
    """Turn about the x axis, then y, then z, through the origin [degrees]."""
    measure: Measured = None
    """Two points, and their true distance [m]."""
    scale: float | None = None
    """Factor of all lengths, in place of --measure."""
    floor: Floor = None
    """Three points on the floor."""
    find_floor: bool = False
    """Find the floor: the plane with most points on it and almost none below."""
    up: Up = None
    """Up direction: X Y Z, or the name of an axis. With a floor, the side of the floor that is up."""
    box: Corners = None
    """Lowest and highest corner of the box to keep [m], after scale and floor."""


def run(arguments: Arguments) -> None:
    """Georeference the field, store it, and print what has changed."""
    turn, measured, floor, box = arguments.turn, arguments.measure, arguments.floor, arguments.box
    correction = AlignmentRequest(
        moved=turn_about_axes(vector(turn)) if turn is not None and any(turn) else None,
        measured=None if measured is None else measured_distance(measured),
        scale=arguments.scale,
        floor=None if floor is None else (vector(floor[:3]), vector(floor[3:6]), vector(floor[6:])),
        find_floor=arguments.find_floor,
        up=None if arguments.up is None else vector(arguments.up),
        box=None if box is None else (vector(box[:3]), vector(box[3:])),
    )
    request = PlaceRequest(arguments.field, correction, arguments.out)
    run_and_print(f"field {arguments.out}", run_job(request), arguments.json)
