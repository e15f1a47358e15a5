"""nerfstudio's run folders: config.yml names the data that a field was trained from, dataparser_transforms.json holds
how nerfstudio turned and moved it; the field itself, a pickle of nerfstudio's own classes, is not read.

The data are learned anew, in nerfstudio's world as far as that is rigid: with T (3 x 4) of the dataparser a camera is
at T T_data_camera; the unit stays that of the data (nerfstudio shrinks them to fit a box of its own, which is no unit).

config.yml is full of tags that name Python objects. None is ever made: tagged nodes are read as the plain mappings,
sequences and strings that they are.
"""

import os
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np
import yaml

from nerfnav.importers.captures.views import LARGEST, CaptureError, Views, array_of, read_json

CONFIG, TRANSFORMS = "config.yml", "dataparser_transforms.json"
_PARENTS = 5
"""Parent folders of a run in which relative paths are resolved: outputs/NAME/METHOD/TIME and the working directory."""
_COLMAP = np.array([[0.0, 1, 0, 0], [1, 0, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]])
"""Transform that nerfstudio assumes for data from COLMAP whose file has no applied_transform."""


class _Plain(yaml.SafeLoader):
    """Reads tags of Python as if they were not there."""


def _plain(loader: yaml.SafeLoader, _: str, node: yaml.Node) -> Any:
    if isinstance(node, yaml.MappingNode):
        return loader.construct_mapping(node, deep=True)
    if isinstance(node, yaml.SequenceNode):
        return loader.construct_sequence(node, deep=True)
    return loader.construct_scalar(node) if isinstance(node, yaml.ScalarNode) else None


_Plain.add_multi_constructor("tag:yaml.org,2002:python/", _plain)


@dataclass(frozen=True)
class Run:
    """Run folder of nerfstudio."""

    data: Path
    """The data that it was trained from."""
    transform: np.ndarray
    """Rigid 4 x 4 transform from the data's world to that of nerfstudio."""


def is_run(path: Path) -> bool:
    """True for a run folder or its config.yml; other programs have files of this name, too."""
    try:
        with _config(path).open("rb") as file:
            return b"python/object:nerfstudio" in file.read(1 << 16)
    except OSError:
        return False


def read_run(path: Path) -> Run:
    """Read the data path and the transform of a run. Raises CaptureError where the data cannot be found."""
    config = _config(path)
    try:
        content = yaml.load(config.read_text(encoding="utf-8", errors="replace"), Loader=_Plain)
    except (yaml.YAMLError, OSError, RecursionError, ValueError, TypeError) as error:
        raise CaptureError(f"{config} is cut off or no configuration of nerfstudio") from error
    transforms = config.parent / TRANSFORMS
    return Run(_found(config, _named(content)), _matrix(transforms) if transforms.is_file() else np.eye(4))


def transform_to_run(views: Views, run: Run) -> Views:
    """Transform the views of a run's data to its world."""
    similarity = run.transform
    file = run.data if run.data.is_file() else run.data / "transforms.json"
    by_colmap = file.is_file() and (file.parent / "colmap" / "sparse" / "0").is_dir()
    if by_colmap and not read_json(file).get("applied_transform"):
        similarity = similarity @ np.linalg.inv(_COLMAP)
    return replace(views.transformed(similarity), kind="nerfstudio run")


def _config(path: Path) -> Path:
    return path / CONFIG if path.is_dir() else path


def _named(content: Any) -> list[PurePosixPath]:
    """Paths that a configuration gives for its data, the most specific first."""
    places = (("pipeline", "datamanager", "dataparser"), ("pipeline", "datamanager"), ())
    paths = []
    for place in places:
        section = content
        for name in place:
            section = section.get(name) if isinstance(section, dict) else None
        parts = section.get("data") if isinstance(section, dict) else None
        parts = [parts] if isinstance(parts, str) else parts
        if isinstance(parts, list) and parts and all(isinstance(part, str) for part in parts):
            paths.append(PurePosixPath(*parts))
    return paths


def _found(config: Path, named: list[PurePosixPath]) -> Path:
    folder = config.resolve().parent
    bases = [Path.cwd(), folder, *list(folder.parents)[:_PARENTS]]
    for path in named:
        # as it is written, from where the run was started; else by its name alone, for runs that were moved with it
        for tail in (path, PurePosixPath(path.name)):
            found = next((base / tail for base in bases if _is_data(base / tail, folder)), None)
            if found is not None:
                return found
    if not named:
        raise CaptureError(f"{config} names no data that it was trained from: give the folder of photographs instead")
    raise CaptureError(
        f"{config} was trained from {named[0]}, which is not here: put that folder beside the run, or train from it"
    )


def _is_data(path: Path, run: Path) -> bool:
    return os.path.exists(path) and path.resolve() != run and not is_run(path)


def _matrix(file: Path) -> np.ndarray:
    """T of the dataparser as a 4 x 4 matrix."""
    rows = array_of(read_json(file).get("transform"))
    whole = rows.shape in ((3, 4), (4, 4)) and bool((np.abs(rows) < LARGEST).all())
    if not whole or np.abs(rows[:3, :3] @ rows[:3, :3].T - np.eye(3)).max() > 1e-3:
        raise CaptureError(f"{file} has no rigid transform of 3 x 4 numbers: it is cut off, or of another program")
    return np.vstack([rows[:3], [0.0, 0.0, 0.0, 1.0]])
