"""nerfnav info: print what a field file holds, measure its geometry, take a picture of it.

The geometry is its free-space accuracy, and its distance from a mesh where one is given.
"""

from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import torch
from tyro.conf import Positional

import nerfnav_scenes as scenes
from nerfnav.core.errors import InvalidInputError
from nerfnav.core.steps import run_steps
from nerfnav.experiments import (
    FreeSpaceAccuracy,
    GeometryReport,
    describe_free_space_accuracy,
    measure_free_space_on_mesh,
    measure_geometry,
    measure_unproven_share,
)
from nerfnav.field import GridField, NeuralField, StoredField, load_field, render_image
from nerfnav.geometry import Camera, Pose, encode_image, look_at
from nerfnav.importers import Placement, SceneConfig, import_mesh
from nerfnav.world import CaptureConfig, Scene, capture_poses, images_taken
from nerfnav_app.cli.arguments import vector
from nerfnav_app.cli.terminal import Output, show
from nerfnav_app.places.place import field_file, ground_truth
from nerfnav_app.storage.output_files import prepare_file, write_bytes

_WIDTH, _HEIGHT, _FOV_DEG = 480, 360, 70.0
_STANDPOINT = (0.62, -0.68, 0.42)
"""Eye of the picture: offset from the middle of the box, in longest edges of it, high enough to see over things."""


def write_picture(field: StoredField, out: Path) -> Path:
    """Write a picture of the field from above one of its corners."""
    prepare_file(out)
    eye = field.box.center + torch.tensor(_STANDPOINT) * field.box.size.max()
    aim = field.box.center - 0.15 * field.box.size * torch.tensor([0.0, 0.0, 1.0])
    seen = render_image(field, Camera.from_fov(_WIDTH, _HEIGHT, _FOV_DEG), look_at(eye, aim))
    return write_bytes(out, encode_image(seen.image.numpy()))


def describe_resolution(field: StoredField) -> dict[str, Any]:
    """Describe the resolution: nodes and their distance, or the shape of the networks and the distance of samples."""
    if isinstance(field, GridField):
        return {"resolution": list(field.shape), "voxel_m": field.resolution}
    if isinstance(field, NeuralField):
        shape = field.fine.config
        return {"layers": shape.depth, "layer_width": shape.width, "voxel_m": field.resolution}
    return {"voxel_m": field.resolution}


def free_space_accuracy_of(field: StoredField, path: Path) -> FreeSpaceAccuracy:
    """Free-space accuracy: as measured when the field was made, else as far as it can be measured now."""
    info, voxel = field.info, describe_resolution(field)["voxel_m"]
    if info.unproven_share is not None:
        return FreeSpaceAccuracy(info.surface_taken_for_free, info.free_taken_for_free, info.unproven_share, voxel)
    truth = ground_truth(field, path)
    if truth is None:
        return measure_unproven_share(field, voxel)
    scene = truth.load()
    return measure_free_space_on_mesh(field, voxel, scene, *_seen_from(field, scene))


def geometry_of(field: StoredField, scene: Scene) -> GeometryReport:
    """Compare the field with the mesh, from the poses of its training photographs."""
    return measure_geometry(field, describe_resolution(field)["voxel_m"], scene, *_seen_from(field, scene))


def _seen_from(field: StoredField, scene: Scene) -> tuple[Camera, Pose]:
    """The camera that a field of a scene was photographed with, and its poses T_world_camera, which the seed tells."""
    learned = field.info.images
    config = CaptureConfig(images=images_taken(learned) if learned else CaptureConfig.images)
    imported = scene.paint is not None  # a place of any size
    config = config.clear_of(describe_resolution(field)["voxel_m"]) if imported else config.suiting(scene)
    poses = capture_poses(scene, config, torch.Generator().manual_seed(field.info.seed))
    return Camera.from_fov(config.width, config.height, config.horizontal_fov_deg), poses


def truth_of(what: str, field: StoredField, path: Path) -> Scene:
    """A bundled scene, or a mesh file: as the field's own ground truth has it where that was made from this file."""
    if what in scenes.names():
        return scenes.load(what)
    if not Path(what).is_file():
        known = ", ".join(scenes.names())
        raise InvalidInputError(f"there is no mesh file {what}, and no scene of that name; known are: {known}")
    own = ground_truth(field, path)
    if own is not None and (scene := own.load()).name == Path(what).name:
        return scene
    box = (vector(field.box.lower.tolist()), vector(field.box.upper.tolist()))
    return run_steps(import_mesh(Path(what), SceneConfig(Placement(box=box)))).scene


@dataclass(frozen=True)
class Arguments(Output):
    """Print what a field file holds."""

    field: Positional[str]
    """Path of a field file, or name of a bundled scene."""
    mesh: str | None = None
    """Ground truth to compare its shape with: a bundled scene, or a mesh file in its frame."""
    png: Path | None = None
    """File for a small picture of the field."""


def run(arguments: Arguments) -> None:
    """Print box, resolution, quality, origin and size; compare with a mesh and take a picture where asked to."""
    path = field_file(arguments.field)
    field = load_field(path)
    summary = {
        "box": {"lower": field.box.lower.tolist(), "upper": field.box.upper.tolist()},
        **describe_resolution(field),
        **asdict(field.info),
        "file_bytes": path.stat().st_size,
    }
    for name in ("surface_taken_for_free", "free_taken_for_free", "unproven_share"):
        del summary[name]  # printed together, below
    if field.info.input_keys is None:
        del summary["input_keys"]  # no capture, or one of an earlier version
    accuracy = free_space_accuracy_of(field, path)
    summary["geometry"] = asdict(accuracy)
    if arguments.mesh is not None:
        summary["geometry"] |= asdict(geometry_of(field, truth_of(arguments.mesh, field, path)))
    summary["in_words"] = describe_free_space_accuracy(accuracy)
    if arguments.png is not None:
        summary["png"] = str(write_picture(field, arguments.png))
    show(str(path), summary, arguments.json)
