"""How good the shape of a field is: what planners take for free there, and how far it is from a mesh."""

from pathlib import Path
from typing import Any

import torch

import nerfnav_scenes as scenes
from nerfnav.errors import InvalidInputError
from nerfnav.experiments import Freedom, GeometryReport, freedom_alone, freedom_on_mesh, measure_geometry
from nerfnav.field import GridField, NeuralField, StoredField
from nerfnav.geometry import Camera, Pose
from nerfnav.importers import Placement, SceneConfig, import_mesh
from nerfnav.world import CaptureConfig, Scene, capture_poses, images_taken
from nerfnav_app.places.place import ground_truth


def grain(field: StoredField) -> dict[str, Any]:
    """How fine the field is: nodes and their distance, or the shape of its networks and the distance of samples."""
    if isinstance(field, GridField):
        return {"resolution": list(field.shape), "voxel_m": field.spacing.max().item()}
    if isinstance(field, NeuralField):
        shape = field.fine.config
        return {"layers": shape.depth, "layer_width": shape.width, "voxel_m": field.step}
    return {"voxel_m": field.step}


def freedom_of(field: StoredField, path: Path) -> Freedom:
    """What planners take for free: as it was measured when the field was made, else as far as it can be now."""
    info, voxel = field.info, grain(field)["voxel_m"]
    if info.unproven_share is not None:
        return Freedom(info.surface_taken_for_free, info.free_taken_for_free, info.unproven_share, voxel)
    truth = ground_truth(field, path)
    if truth is None:
        return freedom_alone(field, voxel)
    scene = truth.load()
    return freedom_on_mesh(field, voxel, scene, _seen_from(field, scene))


def geometry_of(field: StoredField, scene: Scene) -> GeometryReport:
    """The field against the mesh, seen from where the photographs that it was trained from were taken."""
    return measure_geometry(field, grain(field)["voxel_m"], scene, _seen_from(field, scene))


def _seen_from(field: StoredField, scene: Scene) -> tuple[Camera, Pose]:
    """The camera that a field of a scene was photographed with, and its poses T_world_camera, which the seed tells."""
    learned = field.info.images
    config = CaptureConfig(images=images_taken(learned) if learned else CaptureConfig.images)
    imported = scene.paint is not None  # a place of any size
    config = config.clear_of(grain(field)["voxel_m"]) if imported else config.suiting(scene)
    poses = capture_poses(scene, config, torch.Generator().manual_seed(field.info.seed))
    return Camera.from_fov(config.width, config.height, config.horizontal_fov_deg), poses


def truth_of(what: str, field: StoredField, path: Path) -> Scene:
    """A bundled scene, or a mesh file: as the field's own ground truth has it where that was made from this file."""
    if what in scenes.names():
        return scenes.load(what)
    if not Path(what).is_file():
        raise InvalidInputError(f"there is no mesh file {what}, and no scene of that name; known are: {_known()}")
    own = ground_truth(field, path)
    if own is not None and (scene := own.load()).name == Path(what).name:
        return scene
    box = (_corner(field.box.lower), _corner(field.box.upper))
    *_, last = import_mesh(Path(what), SceneConfig(Placement(box=box)))
    assert last.imported is not None  # the last step carries the scene
    return last.imported.scene


def _corner(point: torch.Tensor) -> tuple[float, float, float]:
    x, y, z = point.tolist()
    return x, y, z


def _known() -> str:
    return ", ".join(scenes.names())
