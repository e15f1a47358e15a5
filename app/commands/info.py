"""nerfnav info: what a field file holds, how good its shape is, and what it looks like."""

from dataclasses import asdict, dataclass
from pathlib import Path

import cv2
import torch
import trimesh
from tyro.conf import Positional

import scenes
from app.commands.screen import show
from app.jobs.outputs import prepare_file
from nerfnav.errors import InvalidInputError
from nerfnav.experiments.geometry import GeometryReport, measure_geometry
from nerfnav.field.checkpoint import load_field
from nerfnav.field.render import render_image
from nerfnav.field.voxel import VoxelField
from nerfnav.geometry.camera import Camera, look_at
from nerfnav.world.capture import CaptureConfig, capture_poses, images_taken
from nerfnav.world.scene import Scene

_WIDTH, _HEIGHT, _FOV_DEG = 480, 360, 70.0
_STANDPOINT = (0.62, -0.68, 0.42)
"""Where the picture is taken from: off the box's middle, in longest edges of it, high enough to see over things."""


@dataclass(frozen=True)
class Arguments:
    """Tell what a field file holds."""

    field: Positional[str]
    """Path of a field file, or name of a bundled scene."""
    mesh: str | None = None
    """Name of a bundled scene or path of a mesh, in the field's frame, to judge the field's shape by."""
    png: Path | None = None
    """File for a small picture of the field."""
    json: bool = False
    """Print one JSON object and nothing else."""


def run(arguments: Arguments) -> None:
    """Print box, resolution, quality, origin and size; compare with a mesh and take a picture where asked to."""
    name = arguments.field
    path = scenes.trained_path(name) if name in scenes.names() else Path(name)
    field = load_field(path)
    summary = {
        "box": {"lower": field.box.lower.tolist(), "upper": field.box.upper.tolist()},
        "resolution": list(field.shape),
        "voxel_m": field.spacing.max().item(),
        **asdict(field.info),
        "file_bytes": path.stat().st_size,
    }
    if arguments.mesh is not None:
        summary["geometry"] = asdict(_geometry(field, _truth(arguments.mesh, field)))
    if arguments.png is not None:
        summary["png"] = str(_picture(field, arguments.png))
    show(str(path), summary, arguments.json)


def _geometry(field: VoxelField, scene: Scene) -> GeometryReport:
    """The field against the mesh, seen from where the photographs that it was trained from were taken."""
    learned = field.info.images
    config = CaptureConfig(images=images_taken(learned) if learned else CaptureConfig.images)
    poses = capture_poses(scene, config, torch.Generator().manual_seed(field.info.seed))
    camera = Camera.from_fov(config.width, config.height, config.horizontal_fov_deg)
    return measure_geometry(field, field.spacing.max().item(), scene, (camera, poses))


def _truth(what: str, field: VoxelField) -> Scene:
    """A bundled scene, or a mesh file as a scene in the field's box."""
    if what in scenes.names():
        return scenes.load(what)
    if not Path(what).is_file():
        raise InvalidInputError(f"there is no mesh file {what}, and no scene of that name; known are: {_known()}")
    try:
        mesh = trimesh.load(what, force="mesh")
    except Exception as error:
        raise InvalidInputError(f"{what} cannot be read as a mesh: {error}") from error
    if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0:
        raise InvalidInputError(f"{what} holds no faces: give a mesh, such as .glb, .obj, .ply or .stl")
    return Scene(Path(what).stem, Path(what).name, mesh, (mesh,), field.box, (1.0, 1.0, 1.0), ())


def _known() -> str:
    return ", ".join(scenes.names())


def _picture(field: VoxelField, out: Path) -> Path:
    """What the field looks like from above one of its corners."""
    path = prepare_file(out)
    eye = field.box.center + torch.tensor(_STANDPOINT) * field.box.size.max()
    aim = field.box.center - 0.15 * field.box.size * torch.tensor([0.0, 0.0, 1.0])
    color = render_image(field, Camera.from_fov(_WIDTH, _HEIGHT, _FOV_DEG), look_at(eye, aim)).color
    pixels = (255 * color.clamp(0, 1)).round().byte().numpy()[..., ::-1]
    written, data = cv2.imencode(".png", pixels)
    assert written  # every picture can be a PNG
    path.write_bytes(data.tobytes())
    return path
