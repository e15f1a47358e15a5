"""Obstacles of a run: kept in its folder, in a file that `--obstacles` reads, and placed again where it is opened.

The folders of plans and flights have the file only where there were obstacles; a flight gets it at take-off.
"""

from pathlib import Path

from nerfnav_app.places.place import Place
from nerfnav_app.storage.output_files import OutputError

KEPT = "obstacles.json"
"""File in the folder of a run that holds the obstacles of its place."""


def keep_obstacles(folder: Path, place: Place) -> tuple[Path, ...]:
    """Write the obstacles of a place into the folder of a run, in place of those that it holds; return the files.

    Raises OutputError where they cannot be written.
    """
    path = folder / KEPT
    try:
        path.unlink(missing_ok=True)
        if place.obstacles is None:
            return ()
        from nerfnav.obstacles import write_obstacles  # slow to import, and most places have none

        return write_obstacles(place.obstacles, path)
    except OSError as error:
        raise OutputError(f"cannot write the obstacles into {folder}: {error.strerror}") from error


def open_as_kept(place: Place, folder: Path) -> Place:
    """The place with the obstacles that the folder of a run holds; the place itself where it holds none.

    Raises InvalidInputError for a file that cannot be read.
    """
    path = folder / KEPT
    if not path.is_file():
        return place
    from nerfnav_app.places.obstacles import open_with_obstacles  # slow to import, as above

    return open_with_obstacles(place, path)
