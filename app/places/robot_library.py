"""Library of robots: files that visitors have written or brought, on disk.

One folder for each, named by a digest of the file, so that no flight's robot ever changes under it:

    SHA256 (16 digits)/
        NAME.yaml        what describes the robot, and beside it its mesh
    meshes/              meshes that were brought, for robots that come after them
"""

import re
import shutil
from pathlib import Path

from nerfnav.core.errors import InvalidInputError
from nerfnav.robots import RobotFile, decode_robot_file, load, to_yaml
from nerfnav_app.places.uploads import UploadError, folder_of, safe_name, write_upload

ROBOTS, MESHES = (".yaml", ".yml"), (".stl", ".obj", ".ply", ".glb")
"""Endings of what is taken: robots' files, and the meshes that they name."""
_MOST_BYTES = 32 << 20


class RobotLibrary:
    """Takes and lists robots' files."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def files(self) -> tuple[Path, ...]:
        """The robots that are kept, the newest of each name, by name."""
        known = sorted(self._folder.glob("*/*.yaml"), key=lambda file: file.stat().st_mtime)
        return tuple(sorted({file.stem: file for file in known}.values(), key=lambda file: file.stem.lower()))

    def brought(self, name: str, content: bytes) -> Path | None:
        """Keep a file that was brought: the robot's file, or None where it is a mesh that a robot may name.

        Raises UploadError for files of other kinds, InvalidInputError for a robot that cannot be.
        """
        safe = safe_name(name)
        ending = Path(safe).suffix.lower()
        if ending not in (*ROBOTS, *MESHES) or not 0 < len(content) <= _MOST_BYTES:
            raise UploadError(
                f"{safe} is no robot: these are taken, up to {_MOST_BYTES >> 20} MB: {', '.join((*ROBOTS, *MESHES))}"
            )
        if ending in MESHES:
            write_upload(self._folder / "meshes" / safe, content)
            return None
        brought = self._folder / "brought" / safe
        write_upload(brought, content)
        try:
            return self.keep(decode_robot_file(brought), self._folder / "meshes")
        except InvalidInputError as error:
            raise InvalidInputError(str(error).replace(f"{brought.parent}/", "")) from error
        finally:
            brought.unlink(missing_ok=True)

    def keep(self, robot: RobotFile, meshes: Path) -> Path:
        """Write a robot's file, with its mesh out of the folder `meshes`. Raises InvalidInputError if it cannot be."""
        name = re.sub(r"[^A-Za-z0-9_-]", "_", robot.name).strip("_")[:40] or "robot"
        content = to_yaml(robot)
        beside = [Path(part) for part in (robot.body.mesh, robot.body.urdf) if part is not None]
        beside += [Path(robot.camera.file)] if robot.camera is not None and robot.camera.file is not None else []
        parts = [_read(meshes, part) for part in beside]
        folder = self._folder / folder_of(content, *parts)
        fresh = not folder.exists()
        for part, bytes_ in zip(beside, parts, strict=True):
            write_upload(folder / part.name, bytes_)
        file = folder / f"{name}.yaml"
        write_upload(file, content)
        try:
            load(str(file))
        except InvalidInputError as error:
            if fresh:
                shutil.rmtree(folder, ignore_errors=True)
            raise InvalidInputError(str(error).replace(f"{file}: ", "").replace(f"{folder}/", "")) from error
        return file


def _read(folder: Path, part: Path) -> bytes:
    """A file that a robot's file names: no path leads out of the folder."""
    if part.name != str(part):
        raise InvalidInputError(f"{part} must lie beside the robot's file, and be named without a folder")
    try:
        return (folder / part).read_bytes()
    except OSError as error:
        raise InvalidInputError(f"{part} is not here: bring it first, by the same button, then the robot") from error
