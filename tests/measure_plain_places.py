"""Plain places: train fields of grey places, fly random flights there, and print how true the belief is.

    python -m tests.measure_plain_places train FOLDER           # meshes and fields, each place twice: draft and default
    python -m tests.measure_plain_places fly FOLDER --out RUN   # flights in these fields; one JSON for each field
    python -m tests.measure_plain_places table RUN [RUN ...]    # one line for each field and run

Places: a grey room and a grey corridor, each in three sizes; the obstacle course of the test data; the bundled
apartment in one grey. What is trained or flown already is not repeated: the same command continues.

A flight is one of `nerfnav experiment flights --ends random`, flown by camera and, with --truth, with the state known.
A flight that needs more than --cpu-limit seconds of CPU ends as `hung`, one that raises an error as `crashed`; their
steps so far count. The figures of the table:

    silent      flights with a silent divergence (experiments/closed_loop.py)
    arrived     flights that reached the goal by the truth and were not silent
    truth       with the state known: flights that reached the goal, and that collided
    NEES        of 12 numbers, mean and median (12 and 11.3 are right); inside: share of steps with the truth inside the
                95 % ellipsoid of position; sigma: median root of the trace of the position covariance [cm]. These over
                steps in which the supervisor reports nothing (tracking)
    error       of position, over all steps: median and 95th percentile [cm]
    filter, step   median times [ms]
"""

import argparse
import contextlib
import json
import os
import time
import traceback
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import torch
import trimesh

from nerfnav.core.errors import OccupiedError, OutsideBoxError
from nerfnav.core.steps import run_steps
from nerfnav.experiments import Arena, closed_loop, closed_loop_flight
from nerfnav.experiments.closed_loop_flight import FlightTrial
from nerfnav.importers import Placement
from nerfnav.navigation import NavigationStep
from nerfnav.planner import PlanProblem, settle_ends
from nerfnav_app.jobs.field.request import TrainRequest
from nerfnav_app.jobs.field.train import run as train
from nerfnav_app.jobs.measure.arena import open_arena
from nerfnav_app.places.sources import QualityName
from nerfnav_scenes import apartment
from nerfnav_scenes.furniture import plain
from nerfnav_scenes.light import Light
from nerfnav_scenes.parts import Part, joined
from nerfnav_scenes.primitives import Size, box

GREY = (0.62, 0.62, 0.62)
LIGHT = Light(sun=(0.0, 0.0, 0.0), sky=(1.35, 1.35, 1.35), bounce=(0.40, 0.40, 0.40), sky_rays=112)
"""Light of a ceiling that glows, as in the bundled apartment, without its sun."""
EDGE, WALL, SUNK = 0.12, 0.2, 0.013
"""Legs of triangles; thickness of walls, floor and ceiling; depth to which boxes reach into others, for the importer
takes parts that share vertices for one surface without inside [m]."""
ROBOT, FIRST_SEED = "quadrotor25", 80000
QUALITIES: dict[str, QualityName] = {"draft": "draft", "default": "good"}
HUNG, CRASHED = "hung", "crashed"


@dataclass(frozen=True)
class PlainPlace:
    """A place to train from."""

    mesh: str
    """Name of its mesh."""
    scale: float = 1.0
    """Factor on all lengths of the mesh."""


SCALES = {"small": 0.6, "middle": 1.0, "large": 1.6}
PLACES = {
    "obstacle_world": PlainPlace("obstacle_world"),
    **{f"room_{size}": PlainPlace("room", scale) for size, scale in SCALES.items()},
    **{f"corridor_{size}": PlainPlace("corridor", scale) for size, scale in SCALES.items()},
    "grey_apartment": PlainPlace("apartment"),
}


def block(size: Size, bottom: Size) -> Part:
    """A grey box of `size` [m] that stands at `bottom`, the middle of its foot, and reaches a little below it."""
    long, wide, high = size
    x, y, z = bottom
    return Part.of(box((long, wide, high + SUNK), EDGE), plain(GREY)).placed((x, y, z + (high - SUNK) / 2))


def shell(long: float, wide: float, high: float) -> list[Part]:
    """Floor, walls and ceiling around an inner space that stands on z = 0 [m]."""
    tall, outer = high + 2 * SUNK, (long + 2 * WALL, wide + 2 * WALL)
    ceiling = replace(block((*outer, WALL), (0, 0, high + SUNK)), glass=True)
    sides = [block((WALL, wide + 2 * SUNK, tall), (side * (long + WALL) / 2, 0, 0)) for side in (-1, 1)]
    ends = [block((outer[0], WALL, tall), (0, side * (wide + WALL) / 2, 0)) for side in (-1, 1)]
    return [block((*outer, WALL), (0, 0, -WALL)), *sides, *ends, ceiling]


def room() -> list[Part]:
    """A room of 10 x 11 x 3 m with two pillars, a table, a chest, a cupboard, a shelf and a partition at its walls."""
    return [
        *shell(10, 11, 3),
        block((0.5, 0.5, 3.02), (-2, 2, 0)),
        block((0.4, 0.4, 3.02), (2.5, -2.5, 0)),
        block((1.6, 0.9, 0.75), (0.5, 1.0, 0)),
        block((1.2, 1.0, 0.5), (-1.5, -3.5, 0)),
        block((0.6, 1.8, 2.0), (-4.72, -1.5, 0)),
        block((2.0, 0.4, 1.2), (2.5, 5.32, 0)),
        block((3.0, 0.15, 2.0), (3.53, 1.8, 0)),
    ]


def corridor() -> list[Part]:
    """A corridor like a U, 12 m long, 2 m wide and 2.6 m high, with three steps, three boxes and a beam."""
    steps = [block((0.33, 2.05, 0.17 * (k + 1)), (-0.3 + 0.3 * k, 1.5, 0)) for k in range(3)]
    return [
        *shell(6, 5, 2.6),
        block((2.0, 3.02, 2.62), (0, -1.01, 0)),
        *steps,
        block((0.5, 0.6, 0.8), (-2.77, -0.5, 0)),
        block((0.6, 0.5, 0.5), (1.28, -1.6, 0)),
        block((0.4, 0.4, 1.4), (2.82, 0.4, 0)),
        block((0.3, 2.07, 0.32), (-1.4, 1.5, 2.3)),
    ]


def grey_apartment() -> trimesh.Trimesh:
    """The bundled apartment, every part in the same grey under its own light."""

    def in_grey(parts: Iterable[Part], light: Light) -> tuple[trimesh.Trimesh, tuple[trimesh.Trimesh, ...]]:
        finish = plain(GREY)
        return joined([replace(part, albedo=finish(part.mesh.vertices)) for part in parts], light)

    with mock.patch.object(apartment, "joined", in_grey):
        return apartment.build().mesh


MESHES: dict[str, Callable[[], trimesh.Trimesh]] = {
    "room": lambda: joined(room(), LIGHT)[0],
    "corridor": lambda: joined(corridor(), LIGHT)[0],
    "apartment": grey_apartment,
}


def mesh_file(name: str, folder: Path) -> Path:
    """File of a mesh, made in `folder` if it is not there; that of the obstacle course lies with the test data."""
    if name not in MESHES:
        return Path(os.environ["NERFNAV_TEST_DATA"]) / "plain" / f"{name}.stl"
    path = folder / "meshes" / f"{name}.ply"
    if not path.exists():
        path.parent.mkdir(parents=True, exist_ok=True)
        MESHES[name]().export(path)
    return path


def train_field(name: str, quality: str, folder: Path) -> None:
    """Train the field of a place, with its numbers beside it as JSON."""
    place, out = PLACES[name], field_file(name, quality, folder)
    if out.exists():
        return
    placement = Placement() if place.scale == 1 else Placement(scale=place.scale)
    request = TrainRequest(str(mesh_file(place.mesh, folder)), out, quality=QUALITIES[quality], placement=placement)
    begin = time.perf_counter()
    numbers = run_steps(train(request)).summary
    out.with_suffix(".json").write_text(json.dumps(numbers, default=str))
    took = time.perf_counter() - begin
    print(f"{out}: {numbers['psnr_db']:.1f} dB, {took:.0f} s, {numbers['in_words']}", flush=True)


def field_file(name: str, quality: str, folder: Path) -> Path:
    """File of a field."""
    return folder / f"{name}_{quality}.npz"


def fly(arena: Arena, trial: FlightTrial, cpu_limit: float) -> dict[str, Any]:
    """Fly a trial: its row in the table of the experiment, and `steps`, lists over its time steps."""
    task = closed_loop_flight.find_task(arena, trial)
    flown: list[NavigationStep] = []
    begin, failure = time.process_time(), None
    try:
        problem = closed_loop_flight.make_problem(arena, task, trial)
        failure = _collect(arena, problem, trial, begin + cpu_limit, flown)
    except (OccupiedError, OutsideBoxError):  # refused
        pass
    except Exception:  # the others are to be flown
        failure = CRASHED
        traceback.print_exc()
    steps = closed_loop.steps_of(flown) | {
        "tracking": [step.recovery is None for step in flown[1:]],
        "sigma_m": [step.belief.covariance[:3, :3].trace().sqrt().item() for step in flown[1:]],
    }
    row = closed_loop.row_of(flown, task.goal_state, steps)
    known = {
        "seed": trial.seed, "state": "known" if trial.known else "camera", "start": task.start, "goal": task.goal,
        "cpu_s": time.process_time() - begin,
    }  # fmt: skip
    return {**row, **known, "outcome": failure or row["outcome"], "steps": steps}


def _collect(
    arena: Arena, problem: PlanProblem, trial: FlightTrial, until: float, flown: list[NavigationStep]
) -> str | None:
    """Append the time steps of a flight to `flown`; returns HUNG where it goes on after `until` [s of CPU]."""
    supports = settle_ends(arena.field, problem.field, problem.robot, problem.start, problem.goal)
    if any(support.footing.is_refused for support in supports):
        return None
    for event in closed_loop_flight._flight(arena, problem, trial, None, None):
        if isinstance(event, NavigationStep):
            flown.append(event)
        if time.process_time() > until:
            return HUNG
    return None


def fly_place(field: Path, out: Path, trials: Sequence[FlightTrial], cpu_limit: float) -> None:
    """Fly the trials that `out` does not have yet, and store all of them there after each."""
    flights = json.loads(out.read_text())["flights"] if out.exists() else []
    done = {(flight["seed"], flight["state"]) for flight in flights}
    for trial in trials:
        if (trial.seed, "known" if trial.known else "camera") in done:
            continue
        flights.append(fly(open_arena(str(field)), trial, cpu_limit))
        out.write_text(json.dumps({"place": field.stem, "flights": flights}))
        last = flights[-1]
        print(f"{field.stem} {trial.seed} {last['state']}: {last['outcome']}, {last['cpu_s']:.0f} s", flush=True)


def figures(flights: Sequence[dict[str, Any]]) -> dict[str, str]:
    """Figures of the table, see the top of this file."""
    camera = [flight for flight in flights if flight["state"] == "camera"]
    known = Counter(flight["outcome"] for flight in flights if flight["state"] == "known")
    outcomes = Counter(flight["outcome"] for flight in camera)
    arrived = sum(flight["outcome"] == "reached" and not flight["silent"] for flight in camera)
    tracked, every = partial(_all, camera, tracking=True), partial(_all, camera, tracking=False)
    nees, off = tracked("nees"), every("position_m")
    return {
        "trials": str(len(camera)),
        "outcomes": ", ".join(f"{name} {count}" for name, count in outcomes.most_common()),
        "silent": str(sum(flight["silent"] for flight in camera)),
        "arrived": str(arrived),
        "truth": f"{known['reached']}, {known['collided']} of {known.total()}" if known else "-",
        "NEES": f"{_number(nees, np.mean)} ({_number(nees, np.median)})",
        "inside": f"{_number(100 * tracked('inside_95'), np.mean)} %",
        "sigma": _number(100 * tracked("sigma_m"), np.median),
        "error": f"{_number(100 * off, np.median)} / {_number(100 * off, partial(np.quantile, q=0.95))}",
        "filter": _number(every("filter_ms"), np.median),
        "step": _number(every("step_ms"), np.median),
        "steps": f"{len(nees)} of {len(off)}",
    }


def _all(flights: Sequence[dict[str, Any]], name: str, tracking: bool) -> np.ndarray:
    """Values over the time steps of all flights, of those while tracking alone if asked."""
    return np.array([
        value
        for flight in flights
        for value, tracks in zip(flight["steps"][name], flight["steps"]["tracking"], strict=True)
        if tracks or not tracking
    ], float)  # fmt: skip


def _number(values: np.ndarray, reduce: Callable[[np.ndarray], Any]) -> str:
    return f"{reduce(values):.3g}" if len(values) else "-"


def print_table(runs: Sequence[Path]) -> None:
    """Print the figures of each field, the runs below each other."""
    header = False
    for name in (field_file(name, quality, Path()).stem for name in PLACES for quality in QUALITIES):
        for run in runs:
            path = run / f"{name}.json"
            if not path.exists():
                continue
            row = {"place": name, "run": run.name, **figures(json.loads(path.read_text())["flights"])}
            if not header:
                print("| " + " | ".join(row) + " |\n" + "|---" * len(row) + "|")
                header = True
            print("| " + " | ".join(row.values()) + " |")


def parse_arguments() -> argparse.Namespace:
    """Read the command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(dest="command", required=True)
    for name in ("train", "fly"):
        command = commands.add_parser(name)
        command.add_argument("folder", type=Path, help="folder of the fields")
        command.add_argument("--places", nargs="+", choices=PLACES, default=list(PLACES))
        command.add_argument("--qualities", nargs="+", choices=QUALITIES, default=list(QUALITIES))
    command.add_argument("--out", type=Path, required=True, help="folder of the results")
    command.add_argument("--trials", type=int, default=20)
    command.add_argument("--seed", type=int, default=FIRST_SEED)
    command.add_argument("--truth", action="store_true", help="fly each a second time with the state known")
    command.add_argument("--cpu-limit", type=float, default=90.0, help="longest flight [s of CPU]")
    commands.add_parser("table").add_argument("runs", type=Path, nargs="+")
    return parser.parse_args()


def main() -> None:
    """Run the command."""
    arguments = parse_arguments()
    if arguments.command == "table":
        print_table(arguments.runs)
        return
    torch.set_num_threads(1)
    sets = [(name, quality) for name in arguments.places for quality in arguments.qualities]
    for name, quality in sets:
        field = field_file(name, quality, arguments.folder)
        if arguments.command == "train":
            train_field(name, quality, arguments.folder)
            continue
        arguments.out.mkdir(parents=True, exist_ok=True)
        states = (False, True) if arguments.truth else (False,)
        seeds = range(arguments.seed, arguments.seed + arguments.trials)
        trials = [FlightTrial(None, seed, known, robot=ROBOT) for seed in seeds for known in states]
        fly_place(field, arguments.out / f"{field.stem}.json", trials, arguments.cpu_limit)


if __name__ == "__main__":
    with contextlib.suppress(BrokenPipeError):
        main()
