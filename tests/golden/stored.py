"""Everything that is read from golden files, told as plain values to compare; and where those files are."""

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np

from tests.golden import product as p
from tests.golden.runs import plain, without_later_numbers

DATA = Path(__file__).with_name("data")
"""The folder of golden files."""
FIELDS, RUNS, PLACES, ROBOTS, SESSIONS, EXPORTS = (
    DATA / name for name in ("fields", "runs", "places", "robots", "sessions", "exports")
)
"""Folders of them."""
EXPERIMENT = "2026-01-02-030405-basin"
"""The experiment that is stored among the runs."""


def read(name: str) -> Any:
    """What a golden JSON file says."""
    return json.loads((DATA / name).read_text())


def write(name: str, content: Any) -> None:
    """Write a golden JSON file, an entry of its two outer levels a line, so that changes show as lines."""
    (DATA / name).parent.mkdir(parents=True, exist_ok=True)
    (DATA / name).write_text(_lines(content, 3) + "\n")


def _lines(content: Any, depth: int, indent: str = "") -> str:
    if depth and isinstance(content, dict) and content:
        inner = indent + " "
        rows = [f"{inner}{json.dumps(key)}: {_lines(value, depth - 1, inner)}" for key, value in content.items()]
        return "{\n" + ",\n".join(rows) + f"\n{indent}}}"
    return json.dumps(content, allow_nan=False)


def stored_arrays(path: Path) -> tuple[dict[str, Any], dict[str, dict[str, Any]]]:
    """The header of an npz file, and the dtype, shape and checksum of each of its arrays."""
    with np.load(path, allow_pickle=False) as file:
        header = json.loads(str(file["header"])) if "header" in file.files else {}
        return header, {name: p.digest_of(file[name]) for name in file.files if name != "header"}


def field_told(path: Path) -> dict[str, Any]:
    """What the reader of fields makes of a file, and what is in the file."""
    field = p.load_field(path)
    header, arrays = stored_arrays(path)
    return {
        "header": header,
        "arrays": arrays,
        "class": type(field).__name__,
        "tensors": {name: p.digest_of(tensor) for name, tensor in p.tensors_of(field).items()},
        "told": p.told_by(field),
        "camera": plain(p.camera_of(field)),
    }


def run_told(folder: Path) -> dict[str, Any]:
    """What the readers of a stored flight make of its folder."""
    steps = p.read_steps(folder)
    return {
        "metadata": plain(p.RunMetadata.load(folder)),
        "metrics": plain(without_later_numbers(p.Episode.of(steps).metrics())),
        "steps": [_step(step) for step in steps],
    }


def _step(step: p.NavigationStep) -> dict[str, Any]:
    image = None if step.image is None else [list(step.image.shape), *step.image.double().mean((0, 1)).round().tolist()]
    return plain({
        "index": step.index, "time": step.time, "action": step.action, "truth": step.truth, "mean": step.belief.mean,
        "covariance": step.belief.covariance, "image": image, "plan": step.plan, "touched": step.touched,
        "filter_ms": step.filter_ms, "replan_ms": step.replan_ms, "outcome": step.outcome, "recovery": step.recovery,
        "late": step.late,
    })  # fmt: skip


def places_told(folder: Path) -> dict[str, Any]:
    """What the library of places makes of its folder."""
    library = p.PlaceLibrary(folder)
    entries = [
        {
            "key": entry.key, "name": entry.name, "source": entry.source, "date": entry.date, "field": entry.field,
            "size_bytes": entry.size_bytes, "what": _inside(Path(entry.what), folder),
            "field_file": _inside(entry.field_file, folder), "picture_file": _inside(entry.picture_file, folder),
            "picture": hashlib.sha256(entry.picture_file.read_bytes()).hexdigest(),
        }
        for entry in library.entries()
    ]  # fmt: skip
    return {"entries": entries, "robots": [_inside(file, folder) for file in library.robots.files()]}


def _inside(path: Path, folder: Path) -> str:
    return path.relative_to(folder).as_posix()


def robot_told(path: Path) -> dict[str, Any]:
    """What a robot's file describes, all its numbers told, and the robot that is made of it."""
    told, _ = p.describe_robot(str(path))
    return {"yaml": p.to_yaml(told).decode(), "robot": p.numbers_of_robot(p.robots.load(str(path)))}


def experiment_told() -> dict[str, Any]:
    """What the store makes of a stored experiment."""
    store = p.ExperimentStore(RUNS)
    result = store.result(EXPERIMENT)
    assert result is not None, "the golden experiment is in the store"
    return {
        "names": list(store.names()),
        "name": result.name,
        "numbers": [list(line) for line in result.numbers],
        "figures": [list(figure.shape) for figure in result.figures],
    }
