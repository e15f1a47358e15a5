"""Names of the product that golden files are written and read with.

All that tests/golden imports from nerfnav, app and scenes is imported here, and attributes that are asked of it are
asked here: where modules move or names change, this file alone follows them. What is compared never changes with it.
"""

import contextlib
import hashlib
import io
import json
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import asdict, fields, is_dataclass
from enum import Enum
from pathlib import Path
from typing import Any
from unittest import mock

# isort: off
import nerfnav  # noqa: F401  # before torch: it tells idle threads to sleep, which torch reads when it is loaded
import torch

# isort: on

import msgspec
import numpy as np
import tyro
from torch import Tensor

import nerfnav_scenes as scenes
from nerfnav import robots
from nerfnav.core.renamed import replace_old_options
from nerfnav.estimator import Belief, FilterConfig, FilterOutcome, RelocaliseOutcome
from nerfnav.estimator import estimators as _estimators
from nerfnav.estimator.core.filter_config import DescentConfig
from nerfnav.estimator.photometric.pixel_selection import PixelDraw, PixelSource
from nerfnav.experiments import Results
from nerfnav.export import (
    FORMATS,
    Exported,
    Recording,
    Subject,
    csv_text,
    episode_table,
    json_text,
    motion_table,
    table_of_json,
    texts_of_track,
)
from nerfnav.field import (
    FieldInfo,
    MlpConfig,
    NeuralConfig,
    Occupancy,
    UnknownSpace,
    VoxelField,
    load_field,
    save_field,
)
from nerfnav.field.core.occupancy import EMPTY_RAW
from nerfnav.field.models.bricks import BrickField, convert_to_bricks
from nerfnav.field.models.mlp import Encoding
from nerfnav.field.models.neural import Activation, blank_field
from nerfnav.field.render.surroundings import Surroundings
from nerfnav.field.storage.checkpoint import CODECS
from nerfnav.geometry import Box, Camera, Pose, encode_image, so3
from nerfnav.importers import SourceKind
from nerfnav.importers.meshes.ground_truth import arrays_of as arrays_of_truth
from nerfnav.importers.meshes.ground_truth import load_truth, write_truth_beside
from nerfnav.live.answer import Order
from nerfnav.live.messages import decode_picture_message, decode_server_message, encode_message
from nerfnav.navigation import (
    WORLDS,
    Episode,
    EpisodeOutcome,
    NavigateConfig,
    NavigationStep,
    OperatorRequests,
    SupervisorAction,
    SupervisorState,
)
from nerfnav.planner import PLANNERS, FastPlanConfig, PlanConfig, PlanOutcome, PlanResult, PlanStep
from nerfnav.planner.objective.problem import InitialGuess
from nerfnav.planner.steps import Restart
from nerfnav.robots import Motion, NoiseModel, RigidState, StateNoise, decode_robot_file, describe_robot, to_yaml
from nerfnav.tracking import TrackedFrame
from nerfnav.tracking.frame import TrackStatus
from nerfnav.world import Paint, Scene, Vantage
from nerfnav_app.cli.main import _STYLE, COMMANDS, main, parse
from nerfnav_app.jobs.events import JobEvents, JobResult
from nerfnav_app.jobs.export.recording import read_run
from nerfnav_app.jobs.fly.fly import run as fly
from nerfnav_app.jobs.fly.request import FlyRequest
from nerfnav_app.jobs.measure.catalog import EXPERIMENTS
from nerfnav_app.jobs.measure.results import save_results, table_text
from nerfnav_app.jobs.plan import plan as _plan_job
from nerfnav_app.jobs.plan.plan import PlanRequest
from nerfnav_app.jobs.plan.plan import run as plan
from nerfnav_app.jobs.plan.report import save as save_plan
from nerfnav_app.places.ends import End, EndRole, Ends
from nerfnav_app.places.library import KeptPlace, PlaceLibrary, keep_picture, read_place, write_place
from nerfnav_app.places.place import Place, Truth
from nerfnav_app.places.robot_library import RobotLibrary
from nerfnav_app.state.job import JobKind
from nerfnav_app.state.view import Backdrop, CameraMode
from nerfnav_app.storage.experiment_store import ExperimentStore
from nerfnav_app.storage.output_files import json_line
from nerfnav_app.storage.run_metadata import RunMetadata
from nerfnav_app.storage.run_store import RunStore
from nerfnav_app.storage.step_codec import encode_step
from nerfnav_app.storage.step_log import open_step_log, read_steps
from nerfnav_app.worker.session_memory import SessionMemory

__all__ = [
    "CODECS",
    "COMMANDS",
    "EMPTY_RAW",
    "EXPERIMENTS",
    "FORMATS",
    "Activation",
    "Belief",
    "Box",
    "BrickField",
    "Camera",
    "DescentConfig",
    "Encoding",
    "End",
    "Ends",
    "Episode",
    "EpisodeOutcome",
    "ExperimentStore",
    "Exported",
    "FastPlanConfig",
    "FieldInfo",
    "FilterConfig",
    "FlyRequest",
    "JobEvents",
    "KeptPlace",
    "MlpConfig",
    "Motion",
    "NavigateConfig",
    "NavigationStep",
    "NeuralConfig",
    "Occupancy",
    "OperatorRequests",
    "Paint",
    "Place",
    "PlaceLibrary",
    "PlanConfig",
    "PlanRequest",
    "PlanResult",
    "PlanStep",
    "Pose",
    "Recording",
    "Results",
    "RigidState",
    "RobotLibrary",
    "RunMetadata",
    "RunStore",
    "Scene",
    "SessionMemory",
    "StateNoise",
    "Subject",
    "SupervisorAction",
    "SupervisorState",
    "Surroundings",
    "Truth",
    "UnknownSpace",
    "Vantage",
    "VoxelField",
    "arrays_of_truth",
    "blank_field",
    "convert_to_bricks",
    "csv_text",
    "describe_robot",
    "encode_image",
    "encode_step",
    "episode_table",
    "fly",
    "json_line",
    "json_text",
    "keep_picture",
    "load_field",
    "load_truth",
    "main",
    "motion_table",
    "open_step_log",
    "parse",
    "plan",
    "read_place",
    "read_run",
    "read_steps",
    "robots",
    "save_field",
    "save_plan",
    "save_results",
    "so3",
    "table_of_json",
    "table_text",
    "to_yaml",
    "write_place",
    "write_truth_beside",
]  # fmt: skip

ENUMS: tuple[type[Enum], ...] = (
    Activation, Backdrop, CameraMode, EpisodeOutcome, FilterOutcome, InitialGuess, JobKind, Order, PixelDraw,
    PixelSource, PlanOutcome, SupervisorAction, SupervisorState, RelocaliseOutcome, Restart, SourceKind, Occupancy,
    TrackStatus,
    UnknownSpace, Vantage, EndRole,
)  # fmt: skip
"""Enums whose names or values stand in files, in JSON, in options, or before users."""
ENUM_NAMES = {"SupervisorAction": "Recovery", "EndRole": "Which", "UnknownSpace": "Unknown", "Occupancy": "VoxelState"}
"""Class names of enums that have been renamed since the golden files were written: a class name is no contract."""
REWORDED = {
    "found by global localization": "found from nothing, by looking everywhere",
    "what is left of the last plan has become much more costly": "what is left of the last plan has become much dearer",
}
"""Values of enums that are sentences for users, and were reworded since the golden files were written."""


def digest_of(array: np.ndarray | Tensor) -> dict[str, Any]:
    """The dtype, the shape and the SHA-256 of an array's numbers, little-endian, row by row."""
    told = array.detach().cpu().numpy() if isinstance(array, Tensor) else np.asarray(array)
    plain = np.ascontiguousarray(told.astype(told.dtype.newbyteorder("<")))
    return {"dtype": str(told.dtype), "shape": list(told.shape), "sha256": hashlib.sha256(plain.tobytes()).hexdigest()}


def tensors_of(field: Any) -> dict[str, Tensor]:
    """The tensors of a field that was read: what is computed with, not what is stored."""
    found = {"box.lower": field.box.lower, "box.upper": field.box.upper, "background": field.background}
    if not hasattr(field, "values"):
        found |= {"frame.rotation": field.frame.rotation, "frame.position": field.frame.position}
        for name in ("coarse", "fine"):
            found |= {f"{name}.{key}": part for key, part in getattr(field, name).state_dict().items()}
        return found
    found["values"] = field.values
    if hasattr(field, "slots"):
        found |= {"slots": field.slots, "nodes": torch.tensor(field.nodes)}
    if field.outside is not None:
        found["outside"] = field.outside.values
    if field.evidence is not None:
        found["evidence"] = field.evidence
    return found


def told_by(field: Any) -> dict[str, Any]:
    """The plain values of a field that was read, by the names that its file has for them."""
    told: dict[str, Any] = {"info": asdict(field.info)}
    if hasattr(field, "coarse"):
        told["config"] = {**asdict(field.config), "activation": field.config.activation.value}
        told["networks"] = {name: asdict(getattr(field, name).config) for name in ("coarse", "fine")}
    return json.loads(json.dumps(told))


def camera_of(field: Any) -> dict[str, Any]:
    """The camera that a field's photographs were taken with; empty where nobody noted it."""
    if not field.info.camera:
        return {}
    camera = Camera.of_numbers(field.info.camera)
    return {**asdict(camera), "numbers": list(camera.numbers)}


def numbers_of_robot(robot: Any) -> dict[str, Any]:
    """What a robot that was read from a file is."""
    return {
        "name": robot.name,
        "class": type(robot).__name__.lower(),
        "config": json.loads(json.dumps(asdict(robot.config))) if hasattr(robot, "config") else None,
        "extents": list(robot.body.extents),
        "points": len(robot.body.points_body),
        "corners": [*robot.body.points_body.amin(0).tolist(), *robot.body.points_body.amax(0).tolist()],
        "weights": [float(weight) for weight in robot.action_weights],
        "bounds": [[bound.name, bound.unit, bound.lower, bound.upper] for bound in robot.bounds],
        "camera": [float(number) for number in robot.camera.numbers],
        "mount": [*robot.mount.position.tolist(), *robot.mount.rotation.flatten().tolist()],
        "actions": list(robot.action_names),
        "planar": bool(robot.planar),
    }


@contextlib.contextmanager
def usual_noise() -> Iterator[None]:
    """Let plans allow for the noise of places that show much, as they did everywhere when golden plans were written."""
    with mock.patch.object(_plan_job, "expect_noise_in", lambda _, config, *__: NoiseModel(config.noise)):
        yield


def finished(job: JobEvents, kinds: tuple[type, ...]) -> tuple[list[Any], JobResult]:
    """The events of some kinds that a job yields, and what it returns."""
    seen: list[Any] = []
    while True:
        try:
            event = next(job)
        except StopIteration as end:
            return seen, end.value
        if isinstance(event, kinds):
            seen.append(event)


def session_of(folder: Path, what: str) -> bytes | None:
    """How a place was left, read from its file and written again; None where it cannot be read."""
    last = SessionMemory(folder, what).last()
    return None if last is None else msgspec.json.encode(last)


def session_file(folder: Path, what: str) -> Path:
    """The file in which it is kept how a place was left."""
    return folder / f"{hashlib.sha256(what.encode()).hexdigest()[:16]}.json"


def keep_robot(library: PlaceLibrary, file: Path) -> Path:
    """Keep the robot of a file, with what lies beside it, in a library."""
    return library.robots.keep(decode_robot_file(file), file.parent)


def new_option(old: str) -> str:
    """The name that an option has now."""
    (word,), _ = replace_old_options([old])
    return word


def options_of(command: str, words: Sequence[str] = ()) -> dict[str, dict[str, Any]]:
    """The options of a subcommand: whether each takes a value, its choices, and words that give its default."""
    module, arguments = parse([command, *words])
    shape = module.arguments_for(list(words)) if hasattr(module, "arguments_for") else module.Arguments
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        parser = tyro.extras.get_parser(shape, prog=f"nerfnav {command}", config=_STYLE)
    found = {}
    for action in parser._actions:
        if action.dest == "help":
            continue
        choices = None if action.choices is None else sorted(map(str, action.choices))
        value: Any = arguments
        for part in action.dest.split("."):
            value = getattr(value, part.replace("-", "_"))
        name = action.option_strings[0] if action.option_strings else action.dest
        words_of = None if action.nargs == 0 or not action.option_strings else _words(value)
        found[name] = {"names": list(action.option_strings), "choices": choices, "flag": action.nargs == 0,
                       "default": words_of}  # fmt: skip
    return found


def _words(value: Any) -> list[str]:
    if isinstance(value, Enum):
        return [value.name]
    if isinstance(value, tuple | list):
        return [word for entry in value for word in _words(entry)]
    return [str(value)]


def told_of(value: Any) -> Any:
    """Any record of the product as JSON has it, by the names of its attributes."""
    if is_dataclass(value) and not isinstance(value, type):
        return {part.name: told_of(getattr(value, part.name)) for part in fields(value)}
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, Tensor):
        return value.detach().tolist()
    if isinstance(value, Mapping):
        return {name: told_of(entry) for name, entry in value.items()}
    if isinstance(value, tuple | list):
        return [told_of(entry) for entry in value]
    return value


def ordered(requests: Callable[[int], OperatorRequests]) -> Callable[[], OperatorRequests]:
    """Requests by the number of the time step, as flights ask for them: once for each."""
    counted: Iterator[int] = iter(range(1, 1 << 20))
    return lambda: requests(next(counted))


def registries() -> dict[str, Sequence[str]]:
    """The names in every table that options and files choose from."""
    return {
        "codecs": list(CODECS),
        "formats": list(FORMATS),
        "planners": list(PLANNERS),
        "estimators": list(_estimators.ESTIMATORS),
        "robots": list(robots.ROBOTS),
        "experiments": list(EXPERIMENTS),
        "worlds": list(WORLDS),
        "commands": list(COMMANDS),
        "scenes": list(scenes.names()),
        "endings of formats": [f"{form.name}.{form.ending}" for form in FORMATS.values()],
        "versions of codecs": [f"{codec.name} {codec.version}" for codec in CODECS.values()],
    }


def printed_by_main(words: Sequence[str]) -> dict[str, Any]:
    """What a command prints with --json."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        code = main([*words, "--json"])
    assert code == 0, err.getvalue()
    return json.loads(out.getvalue().splitlines()[-1])


def track_texts(placed: bool) -> dict[str, str]:
    """The files of a track with a frame of each status, in the field's coordinates or in those of its capture."""
    made = []
    for index, status in enumerate(TrackStatus):
        state = RigidState.at_rest((0.25 * index, -0.5, 0.125), 0.25 * index)
        belief = Belief(state, 0.001 * (torch.eye(12) + 0.125)) if status.knows else None
        mount = Pose(so3.exp(torch.tensor([0.0, 0.25, 0.0])), torch.tensor([0.125, 0.0, 0.0625]))
        made.append(
            TrackedFrame(0.5 * index, f"{index:03}.png", status, belief, mount, 2.5, None if index == 0 else 0.0625)
        )
    numbers = (2.0, 0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.125, 0.25, 0.375) if placed else ()
    return texts_of_track(made, numbers)


def resaid(message: str) -> tuple[str, str]:
    """A message between a vehicle and the server, read and written again, as JSON and by way of MessagePack."""
    read = decode_picture_message if json.loads(message)["type"] == "picture" else decode_server_message
    packed = encode_message(read(message))
    return str(encode_message(read(message), text=True)), str(encode_message(read(packed), text=True))
