"""Write the golden files anew: `python -m tests.golden.write_golden [PART ...]`, run where nothing has changed yet.

Parts are fields, runs, places, robots, sessions, computed, exports and contracts; without any, all are written.
The experiment among the runs is written by hand: `nerfnav experiment basin --trials 2 --out` its folder.
"""

import json
import shutil
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import torch

from tests.golden import contracts, exports, places, runs, stored
from tests.golden import product as p


def write_fields() -> None:
    """Write a field of each codec, the room, fields of earlier versions, and a ground truth."""
    folder = _fresh(stored.FIELDS)
    voxel = folder / "voxel.npz"
    with p.write_truth_beside(places.truth_scene(), voxel) as link:
        p.save_field(places.voxel_field(places.info_of("voxel", link.name, link.sha256)), voxel)
    bricks = places.voxel_field(places.info_of("bricks"), (14, 13, 11), seed=6)
    p.save_field(p.convert_to_bricks(bricks), folder / "bricks.npz")
    p.save_field(places.neural_field(places.info_of("neural")), folder / "neural.npz")
    p.save_field(places.room(), folder / "room.npz")
    _write_earlier(voxel, folder)
    told = {path.stem: stored.field_told(path) for path in sorted(folder.glob("*.npz")) if "truth" not in path.name}
    stored.write("fields.json", told)
    header, arrays = stored.stored_arrays(folder / "voxel.truth.npz")
    stored.write("truth.json", {"header": header, "arrays": arrays})


def _write_earlier(voxel: Path, folder: Path) -> None:
    """Voxel fields as versions 1 and 2 of the format had them: with less known of them, unseen nodes as bits."""
    with np.load(voxel) as file:
        arrays = {name: file[name] for name in file.files}
    header = json.loads(str(arrays.pop("header")))
    unseen = arrays.pop("evidence") == 2
    first = ("source", "created", "images", "train_s", "psnr_db", "noise_std", "seed", "iterations")
    info = {name: header["info"][name] for name in first}
    for version, kept in ((2, arrays | {"unknown": np.packbits(unseen)}), (1, arrays)):
        parts = {name: part for name, part in kept.items() if version == 2 or not name.startswith("outside")}
        text = json.dumps({**header, "info": info | {"left_out_since": 1}, "version": version})
        np.savez_compressed(folder / f"voxel_version{version}.npz", **parts, header=np.array(text))


def write_runs() -> None:
    """Write a flight in which everything happens, one that ends in every way, and a plan."""
    kept = stored.RUNS / "experiments"
    for folder in ("flight", "outcomes"):
        shutil.rmtree(stored.RUNS / folder, ignore_errors=True)
    _write_flight("flight", places.flight_steps(), places.metadata())
    _write_flight("outcomes", places.outcome_steps(), places.metadata(task=None, open_loop=False))
    folder, robot = stored.RUNS / "flight", p.robots.load("quadrotor")
    episode = p.Episode.of(places.flight_steps())
    episode.save(folder)
    table = p.episode_table(episode, robot.action_names, robot.name)
    (folder / "trajectory.csv").write_text(p.csv_text(table))
    (folder / "trajectory.json").write_text(p.json_text(table))
    _write_plan()
    stored.write("runs.json", {name: stored.run_told(stored.RUNS / name) for name in ("flight", "outcomes")})
    if kept.is_dir():
        stored.write("experiment.json", stored.experiment_told())


def _write_flight(name: str, steps: tuple[p.NavigationStep, ...], known: p.RunMetadata) -> None:
    folder = _fresh(stored.RUNS / name)
    with p.open_step_log(folder, known, p.Episode.metrics) as log:
        assert log is not None, "a folder is given"
        for step in steps:
            log.append(step)


def _write_plan() -> None:
    """The plan of which exports are made, as `nerfnav plan --out` writes it, its measured time set to a number."""
    folder = _fresh(stored.DATA / "plan")
    robot, request = runs.plan_requests()["fast quadrotor"]
    place = runs.room_for(robot, places.room())
    steps, result = p.finished(p.plan(request, place), (p.PlanStep,))
    p.save_plan(folder, steps[-1].motion, place, {**result.summary, "wall_s": 0.5}, request.unknown)


def write_places() -> None:
    """Write a library with a place that was opened, and a robot."""
    folder = _fresh(stored.PLACES)
    library = p.PlaceLibrary(folder)
    source = library.keep("A room (1).npz", (stored.FIELDS / "room.npz").read_bytes())
    field = source.with_name("field.npz")
    shutil.copy(stored.FIELDS / "bricks.npz", field)
    place = p.KeptPlace(source.parent.name, "My room", source.name, places.DATE, field.name, source.parent)
    p.write_place(place)
    p.keep_picture(place, p.encode_image(np.full((8, 12, 3), 100, np.uint8), 85))
    p.keep_robot(library, stored.ROBOTS / "settee.yaml")
    stored.write("places.json", stored.places_told(folder))


def write_robots() -> None:
    """Write robots' files, and what they describe."""
    folder = _fresh(stored.ROBOTS)
    (folder / "hull.stl").write_bytes(places.hull())
    (folder / "lens.yaml").write_text(places.lens_text())
    for name, text in places.ROBOTS.items():
        (folder / f"{name}.yaml").write_text(text)
    told = {name: stored.robot_told(folder / f"{name}.yaml") for name in places.ROBOTS}
    bundled = {name: p.numbers_of_robot(p.robots.load(name)) for name in p.robots.ROBOTS}
    stored.write("robots.json", {"files": told, "bundled": bundled})


def write_sessions() -> None:
    """Write how a place was left."""
    file = p.session_file(_fresh(stored.SESSIONS), places.SESSION_OF)
    file.write_text(json.dumps(places.SESSION, separators=(",", ":")))
    assert p.session_of(stored.SESSIONS, places.SESSION_OF) == file.read_bytes(), "the session is whole"


def write_computed() -> None:
    """Write the golden plans and flights step by step, and with which arithmetic they were computed."""
    found = runs.computed()
    stored.write("plans.json", found["plans"])
    stored.write("flights.json", found["flights"])
    stored.write("arithmetic.json", runs.arithmetic())


def write_exports() -> None:
    """Write the exports of the golden runs: small ones whole, and the digests of all."""
    folder = _fresh(stored.EXPORTS)
    found: dict[str, dict[str, Any]] = {}
    recordings = exports.recordings(stored.DATA, p.load_field(stored.FIELDS / "room.npz"))
    for title in [name for name in recordings if name != exports.ESTIMATE]:
        found[title] = {}
        for name, form in exports.wanted(recordings[title]).items():
            exported = exports.exported(recordings, title, form)
            parts = exports.parts_of(name, exported.content)
            found[title][name] = {
                "parts": {part: exports.digest(content) for part, content in parts.items()},
                "packed": exports.packed_by(name, exported.content),
                "info": runs.plain(exported.info),
            }
            if len(parts) == 1 and len(exported.content) <= exports.KEPT_BYTES:
                (folder / f"{title}.{name}.{form.ending}".replace(" ", "_")).write_bytes(exported.content)
    stored.write("exports.json", found)
    with tempfile.TemporaryDirectory() as beside:
        for name, content in exports.others(stored.DATA, Path(beside)).items():
            (folder / name).parent.mkdir(exist_ok=True)
            (folder / name).write_bytes(content)


def write_contracts() -> None:
    """Write the names that other programs rely on."""
    stored.write("cli_options.json", contracts.options())
    stored.write("enums.json", contracts.enums())
    stored.write("registered.json", contracts.registered())
    with tempfile.TemporaryDirectory() as out:
        commands = contracts.commands_with_json(stored.FIELDS, Path(out))
        found = {name: contracts.keys(p.printed_by_main(words)) for name, words in commands.items()}
    stored.write("json_keys.json", found)


PARTS: dict[str, Callable[[], None]] = {
    "fields": write_fields, "runs": write_runs, "robots": write_robots, "places": write_places,
    "sessions": write_sessions, "computed": write_computed, "exports": write_exports,
    "contracts": write_contracts,
}  # fmt: skip
"""Name to what writes a part, in the order in which they need each other."""


def _fresh(folder: Path) -> Path:
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    return folder


def main(names: list[str]) -> None:
    """Write the parts that are named, or all."""
    torch.set_num_threads(1)
    for name in names or PARTS:
        PARTS[name]()
        print(f"wrote {name}")


if __name__ == "__main__":
    main(sys.argv[1:])
