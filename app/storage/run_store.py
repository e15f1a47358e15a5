"""The folder of flights: each has a folder of its own, whose name is the flight's. Nothing outside it is touched."""

import os
import re
import shutil
from datetime import UTC, datetime
from pathlib import Path

from nerfnav.core.errors import InvalidInputError, UnknownNameError
from nerfnav.navigation import NavigationStep
from nerfnav_app.places.uploads import NameRefusedError, check_name
from nerfnav_app.storage import run_metadata as about
from nerfnav_app.storage.output_files import OutputError, prepare_folder
from nerfnav_app.storage.step_codec import FILE
from nerfnav_app.storage.step_log import count_steps, is_locked, read_steps

VARIABLE = "NERFNAV_RUNS"
"""Environment variable that names the folder."""
MOST_LISTED = 200
"""Flights that are listed at most; older ones can still be named."""
_LONGEST_NAME = 80


class RunStore:
    """Lists, opens, renames and deletes flights."""

    def __init__(self, folder: Path | None = None) -> None:
        """Without a folder, the one that NERFNAV_RUNS names, else runs/ where the program was started."""
        self.folder = folder if folder is not None else Path(os.environ.get(VARIABLE) or "runs")
        self._known: dict[str, tuple[int, about.StoredRun]] = {}

    def new(self, place: str) -> Path:
        """Make the folder of a new flight in a place, named after the time. Raises OutputError where that fails."""
        try:
            prepare_folder(self.folder)
        except OutputError as error:  # browsers read this: it does not say where the folder is
            raise OutputError(f"cannot write into the folder of flights: let {VARIABLE} name another one") from error
        harmless = re.sub(r"[^A-Za-z0-9._-]", "_", place)[:40]
        name = f"{datetime.now(UTC):%Y-%m-%d-%H%M%S}-{harmless}".rstrip(".")
        for count in range(1, 1000):
            path = self.folder / (name if count == 1 else f"{name}-{count}")
            try:
                path.mkdir()
                return path
            except FileExistsError:
                continue
            except OSError as error:
                raise OutputError(f"cannot write into the folder of flights: {error.strerror}") from error
        raise OutputError("the folder of flights holds too many of this second")

    def without_folder(self, text: str) -> str:
        """A text for visitors, which does not say where the folder is."""
        return text.replace(str(self.folder), "the folder of runs")

    def entries(self) -> tuple[about.StoredRun, ...]:
        """The newest flights, the very newest first; folders that hold something else are passed over."""
        try:
            folders = [path for path in self.folder.iterdir() if not path.is_symlink() and (path / FILE).is_file()]
        except OSError:
            return ()
        entries = [entry for path in folders if (entry := self._read(path)) is not None]
        return tuple(sorted(entries, key=lambda entry: (entry.metadata.date, entry.name), reverse=True)[:MOST_LISTED])

    def path(self, name: str) -> Path:
        """The folder of a flight. Raises NerfnavError for a bad name and for one that no flight has."""
        path = self.folder / checked(name)
        if path.is_symlink() or not (path / FILE).is_file():
            raise UnknownNameError("flight", name, [entry.name for entry in self.entries()])
        return path

    def entry(self, name: str) -> about.StoredRun:
        """Metadata and steps of a flight. Raises NerfnavError where that cannot be read."""
        path = self.path(name)
        return _entry(path) or about.StoredRun(name, about.RunMetadata.load(path), 0)

    def steps(self, name: str) -> tuple[NavigationStep, ...]:
        """The steps of a flight as far as they were written. Raises NerfnavError where there are none."""
        return read_steps(self.path(name))

    def rename(self, name: str, to: str) -> None:
        """Give a flight another name. Raises NerfnavError where it is bad, taken, or the flight is under way."""
        path, target = self._at_rest(name), self.folder / checked(to)
        if name == to:
            return
        if os.path.lexists(target):
            raise NameRefusedError(f"there is already something called {to!r}: choose another name")
        try:
            path.rename(target)
        except OSError as error:
            raise OutputError(f"{name} cannot be renamed: {error.strerror}") from error

    def delete(self, name: str) -> None:
        """Delete a flight for good. Raises NerfnavError where there is none, or it is under way."""
        try:
            shutil.rmtree(self._at_rest(name))
        except OSError as error:
            raise OutputError(f"{name} cannot be deleted: {error.strerror}") from error

    def _read(self, path: Path) -> about.StoredRun | None:
        """Metadata of a flight; that of an ended flight is read only once."""
        try:
            stamp = (path / about.FILE).stat().st_mtime_ns
        except OSError:
            return None
        known = self._known.get(path.name)
        if known is not None and known[0] == stamp:
            return known[1]
        entry = _entry(path)
        if entry is not None and entry.metadata.outcome is not None:
            self._known[path.name] = stamp, entry
        return entry

    def _at_rest(self, name: str) -> Path:
        path = self.path(name)
        if is_locked(path / FILE):
            raise InvalidInputError(f"{name} is being flown: wait for its end, or stop it")
        return path


def checked(name: str) -> str:
    """The name, if a flight can have it. Raises NameRefusedError."""
    return check_name(name, _LONGEST_NAME)


def _entry(path: Path) -> about.StoredRun | None:
    try:
        known = about.RunMetadata.load(path)
    except InvalidInputError:
        return None
    steps = known.metrics.get("steps")
    counted = steps if isinstance(steps, int) else count_steps(path)
    return about.StoredRun(path.name, known, counted, known.outcome is None and is_locked(path / FILE))
