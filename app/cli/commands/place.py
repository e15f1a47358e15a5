"""nerfnav place: put a field right by hand, without training again."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional

from nerfnav.importers import AlignmentRequest
from nerfnav_app.cli.commands.train import Corners, Up, measured_distance, vector
from nerfnav_app.cli.number_arguments import numbers_argument
from nerfnav_app.cli.progress import run_and_print
from nerfnav_app.jobs.field.georeference import PlaceRequest
from nerfnav_app.jobs.field.georeference import run as run_job

Measured = Annotated[tuple[float, ...] | None, numbers_argument("measure", "X Y Z X Y Z DISTANCE")]
Floor = Annotated[tuple[float, ...] | None, numbers_argument("floor", "X Y Z X Y Z X Y Z")]


@dataclass(frozen=True)
class Arguments:
    """Say how long a metre is, where the floor is and what is wanted of a field; it is not trained again.

    Points are in the field's own coordinates, as it is; numbers may be separated by commas. The floor comes to z = 0.
    What was guessed, and what has changed, is printed.
    """

    field: Positional[str]
    """Path of a field file, or name of a bundled scene."""
    out: Path
    """File for the field; splats and ground truth are kept beside it. Not the field itself."""
    measure: Measured = None
    """Two points, and how far they are apart in truth [m]."""
    scale: float | None = None
    """How many metres a metre of before is, in place of a measured distance."""
    floor: Floor = None
    """Three points on the floor."""
    find_floor: bool = False
    """Look for the floor: the plane that most lies on, with next to nothing below."""
    up: Up = None
    """A direction that is up, X Y Z or the name of an axis; with a floor, it says on which side of that."""
    box: Corners = None
    """Lowest and highest corner of what is kept [m], after scale and floor."""
    json: bool = False
    """Print one JSON object and nothing else."""


def run(arguments: Arguments) -> None:
    """Put the field right, store it, and print what has changed."""
    measured, floor, box = arguments.measure, arguments.floor, arguments.box
    correction = AlignmentRequest(
        measured=None if measured is None else measured_distance(measured),
        scale=arguments.scale,
        floor=None if floor is None else (vector(floor[:3]), vector(floor[3:6]), vector(floor[6:])),
        find_floor=arguments.find_floor,
        up=None if arguments.up is None else vector(arguments.up),
        box=None if box is None else (vector(box[:3]), vector(box[3:])),
    )
    request = PlaceRequest(arguments.field, correction, arguments.out)
    run_and_print(f"field {arguments.out}", run_job(request), arguments.json)
