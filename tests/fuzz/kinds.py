"""Kinds of inputs: how a tiny valid one is made, which of its files are damaged, and the command that reads it.

Commands are the cheapest that read all of the file: none trains for more than one step on tiny pictures.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import cv2
import numpy as np
import torch
import trimesh
import yaml
from rosbags.rosbag2 import StoragePlugin

from nerfnav.export.tables import json_text
from nerfnav.field.core.info import FieldInfo
from nerfnav.field.models.bricks import convert_to_bricks
from nerfnav.field.models.mlp import Encoding, MlpConfig, RadianceMlp
from nerfnav.field.models.neural import NeuralField
from nerfnav.field.models.voxel import EMPTY_RAW, VoxelField
from nerfnav.field.storage.checkpoint import save_field
from nerfnav.geometry.box import Box
from nerfnav.geometry.camera import FORWARD_MOUNT
from nerfnav_app.storage.run_store import RunStore
from tests.app.storage.stored_runs import put
from tests.export.flights import arrived, curve, flown, hover_to_hover
from tests.importers import splat_files
from tests.importers.captures.synthetic import write_colmap, write_points, write_transforms
from tests.importers.captures.test_video import pattern, write_video
from tests.importers.meshes import places
from tests.tracking.recordings import Recorded, bag_folder, mcap_file, picture

FIELD = "field.npz"
"""Field in the folder of each input, to track, localize and plan in."""


@dataclass(frozen=True)
class Kind:
    """Kind of input."""

    make: Callable[[Path], object]
    """Writes a valid one into a folder."""
    damaged: tuple[str, ...]
    """Patterns of the files that are damaged, one of them at a time."""
    command: Callable[[Path, Path], list[str]]
    """Command line that reads it, of its folder and a folder for what is written."""
    about: tuple[str, ...] = ()
    """What a sentence may name in place of a file: of a whole robot that is large, the end where it does not fit."""


def write_field(path: Path) -> None:
    """Write a field of 2 m x 2 m x 1 m with a column in its middle."""
    save_field(_column(), path)


def _column() -> VoxelField:
    values = torch.full((13, 13, 7, 4), EMPTY_RAW)
    values[5:8, 5:8, :, 0] = 1.0
    x, y, z = torch.meshgrid(*(torch.linspace(0, 6, count) for count in values.shape[:3]), indexing="ij")
    values[..., 1:] = 0.5 + 0.4 * torch.stack([x, y, z], -1).sin()
    box = Box.of((-1, -1, 0), (1, 1, 1))
    evidence = torch.zeros(values.shape[:3], dtype=torch.uint8)
    info = FieldInfo(source="a test", created="2026-01-01T00:00:00", images=8, psnr_db=30.0, noise_core_std=0.02)
    return VoxelField(box, values, torch.ones(3), info, evidence=evidence)


def _fields(folder: Path, form: str) -> None:
    column = _column()
    if form == "voxels":
        save_field(column, folder / "place.npz")
    elif form == "bricks":
        save_field(convert_to_bricks(column), folder / "place.npz")
    else:
        config = MlpConfig(2, 8, (), Encoding(2), Encoding(1), (4,))
        networks = (RadianceMlp(config), RadianceMlp(config))
        save_field(NeuralField(column.box, *networks, column.background, FORWARD_MOUNT), folder / "place.npz")


_TRAIN = ("--iterations", "1", "--voxel", "0.5", "--held-out-every", "4")


def _train(source: str, *more: str) -> Callable[[Path, Path], list[str]]:
    return lambda folder, out: ["train", str(folder / source), "--out", str(out / "made.npz"), *_TRAIN, *more]


def _info_mesh(name: str) -> Callable[[Path, Path], list[str]]:
    return lambda folder, out: [
        "info", str(folder / FIELD), "--mesh", str(folder / name)
    ]  # fmt: skip


def _import(name: str) -> Callable[[Path, Path], list[str]]:
    return lambda folder, out: ["import", str(folder / name), "--out", str(out / "made.npz"), "--voxel", "0.25"]


def _info(folder: Path, out: Path) -> list[str]:
    return ["info", str(folder / "place.npz")]


def _info_with_picture(folder: Path, out: Path) -> list[str]:
    return [*_info(folder, out), "--png", str(out / "a.png")]


def _plan(folder: Path, out: Path) -> list[str]:
    ends = ("--start", "-0.7", "-0.7", "0.5", "--goal", "-0.7", "0.0", "0.5")
    few = ("--steps", "10", "--newton.iterations", "3")
    return ["plan", str(folder / FIELD), *ends, *few, "--robot", str(folder / "robot.yaml"), "--out", str(out / "plan")]


def _localize(name: str) -> Callable[[Path, Path], list[str]]:
    return lambda folder, out: [
        "localize", str(folder / FIELD), str(folder / "a.png"), "--camera", str(folder / name)
    ]  # fmt: skip


def _track(source: str, *more: str) -> Callable[[Path, Path], list[str]]:
    return lambda folder, out: [
        "track", str(folder / FIELD), str(folder / source), "--out", str(out / "track"), "--no-pictures", *more
    ]  # fmt: skip


def _export(name: str, *formats: str) -> Callable[[Path, Path], list[str]]:
    """Export in one of the formats, by the name of the folder for what is written, so that all have their turn."""
    return lambda folder, out: [
        "export", str(folder / name), "--force", "--out", str(out / "made"),
        "--format", formats[sum(map(ord, out.name)) % len(formats)],
    ]  # fmt: skip


def _mesh(folder: Path, name: str) -> None:
    if name.endswith(".stl"):
        places.quad(-1, 1).export(folder / name)
    elif name.endswith(".dae"):
        places.write_collada([(places.quad(-1, 0), (200, 30, 10)), (places.quad(0, 1), (20, 180, 40))], folder / name)
    else:
        places.write(places.two_textures(pbr=not name.endswith(".obj")), folder / name)


def _ascii_mesh(folder: Path) -> None:
    text = places.quad(-1, 1).export(file_type="ply", encoding="ascii")
    assert isinstance(text, bytes)
    (folder / "a.ply").write_bytes(text)


_SCOUT = "name: scout\nkind: quadrotor\nmass: 0.7\ninertia: [4.0e-3, 4.0e-3, 7.3e-3]\nbody: {}\nlimits: {{tilt: 0.9}}\n"
_BODIES = {
    "box": "{box: [0.25, 0.25, 0.08], points: [3, 3, 2]}",
    "spheres": "{spheres: [[0, 0, 0, 0.1], [0.2, 0, 0, 0.05]]}",
    "mesh": "{mesh: hull.stl, spacing: 0.1}",
    "urdf": "{urdf: bot.urdf, spacing: 0.1}",
}
_URDF = (
    '<robot name="bot"><link name="base"><collision><geometry><box size="0.4 0.3 0.2"/></geometry></collision></link>'
    '<link name="mast"><collision><origin xyz="0 0 0.2"/><geometry><mesh filename="hull.stl" scale="0.5 0.5 0.5"/>'
    '</geometry></collision></link><joint name="up" type="revolute"><parent link="base"/><child link="mast"/>'
    '<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/></joint></robot>'
)


def _robot(folder: Path, body: str) -> None:
    camera = "camera: {position: [0.1, 0, 0.05], pitch: 0.2, width: 32, height: 24, fov: 60}\n"
    (folder / "robot.yaml").write_text(_SCOUT.format(_BODIES[body]) + camera)
    (folder / "bot.urdf").write_text(_URDF)
    trimesh.creation.box((0.3, 0.2, 0.1)).export(folder / "hull.stl")


_ROS = {
    "image_width": 32, "image_height": 24, "camera_name": "a", "distortion_model": "plumb_bob",
    "camera_matrix": {"rows": 3, "cols": 3, "data": [30.0, 0.0, 16.0, 0.0, 31.0, 12.0, 0.0, 0.0, 1.0]},
    "distortion_coefficients": {"rows": 1, "cols": 5, "data": [-0.2, 0.05, 0.001, -0.002, 0.0]},
}  # fmt: skip
_KALIBR = {
    "cam0": {
        "camera_model": "pinhole", "intrinsics": [30.0, 31.0, 16.0, 12.0], "distortion_model": "radtan",
        "distortion_coeffs": [-0.2, 0.05, 0.001, -0.002], "resolution": [32, 24], "rostopic": "/cam0",
    }
}  # fmt: skip
_NERFSTUDIO = {
    "camera_model": "OPENCV", "w": 32, "h": 24, "fl_x": 30.0, "fl_y": 31.0, "cx": 16.0, "cy": 12.0, "k1": -0.2,
    "k2": 0.05, "p1": 0.001, "p2": -0.002, "frames": [],
}  # fmt: skip
_OPENCV = """%YAML:1.0
---
image_width: 32
image_height: 24
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 30., 0., 16., 0., 31., 12., 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ -0.2, 0.05, 0.001, -0.002, 0. ]
"""
_CAMERAS = {
    "ros.yaml": yaml.safe_dump(_ROS),
    "kalibr.yaml": yaml.safe_dump(_KALIBR),
    "camera.json": json.dumps(_NERFSTUDIO),
    "opencv.yml": _OPENCV,
    "cameras.txt": "# Camera list\n1 OPENCV 32 24 30 31 16 12 -0.2 0.05 0.001 -0.002\n",
}


def _camera(folder: Path, name: str) -> None:
    (folder / name).write_text(_CAMERAS[name])
    cv2.imwrite(str(folder / "a.png"), picture())


def _plan_folder(folder: Path) -> None:
    recording = hover_to_hover(8)
    (folder / "plan").mkdir()
    (folder / "plan" / "trajectory.json").write_text(json_text(recording.table))
    (folder / "plan" / "plan.json").write_text('{"outcome": "converged"}\n')


def _flight(folder: Path) -> None:
    first, *others = arrived(curve(6))
    pictures = [step.image for step in flown(6, 8)]
    steps = [first, *(replace(step, image=image) for step, image in zip(others, pictures[1:], strict=True))]
    put(RunStore(folder), "flight", steps)


def _tum(folder: Path) -> None:
    scan = folder / "scan"
    (scan / "rgb").mkdir(parents=True)
    lines = []
    for index in range(2):
        name = f"rgb/{10 + 0.1 * index:.6f}.png"
        cv2.imwrite(str(scan / name), picture(index))
        lines.append(f"{10 + 0.1 * index:.6f} {name}")
    (scan / "rgb.txt").write_text("\n".join(["# color images", "# timestamp filename", *lines]) + "\n")


def _euroc(folder: Path) -> None:
    camera, imu = folder / "scan" / "mav0" / "cam0", folder / "scan" / "mav0" / "imu0"
    (camera / "data").mkdir(parents=True)
    imu.mkdir()
    times = [1403636579763555584 + 50_000_000 * index for index in range(2)]
    for index, time in enumerate(times):
        cv2.imwrite(str(camera / "data" / f"{time}.png"), picture(index))
    (camera / "data.csv").write_text("#timestamp [ns],filename\n" + "".join(f"{time},{time}.png\n" for time in times))
    sensor = {
        "sensor_type": "camera", "resolution": [32, 24], "rate_hz": 20, "camera_model": "pinhole",
        "intrinsics": [30.0, 31.0, 16.0, 12.0], "distortion_model": "radial-tangential",
        "distortion_coefficients": [-0.28, 0.07, 0.0002, 1.8e-05],
        "T_BS": {"cols": 4, "rows": 4, "data": [float(part) for part in np.eye(4).ravel()]},
    }  # fmt: skip
    (camera / "sensor.yaml").write_text("%YAML:1.0\n" + yaml.safe_dump(sensor))
    lines = "".join(f"{times[0] + 5_000_000 * step},0.1,0.2,{step},0,0,9.81\n" for step in range(20))
    (imu / "data.csv").write_text(f"#timestamp [ns],w_RS_S_x [rad s^-1],w_y,w_z,a_x,a_y,a_z\n{lines}")


def _bag(folder: Path, form: str) -> None:
    recorded = Recorded(pictures=2)
    opened = {
        "scan.mcap": mcap_file,
        "sqlite": bag_folder,
        "mcap": partial(bag_folder, storage=StoragePlugin.MCAP),
    }[form]
    with opened(folder / (form if form == "scan.mcap" else "scan")) as write:
        recorded.write(write)


def _video(folder: Path, name: str) -> None:
    write_video(folder / name, [pattern(index, (24, 32)) for index in range(2)])


def _colmap(folder: Path, binary: bool) -> None:
    scan = write_colmap(folder / "scan", binary)
    write_points(scan, binary, [((0.1 * index, 0.2, 0.3), 0.5, [1, 2, 3]) for index in range(5)])


def _splats(folder: Path, name: str) -> None:
    writers = {
        "a.ply": splat_files.write_inria,
        "a.compressed.ply": splat_files.write_compressed,
        "a.splat": splat_files.write_dot_splat,
        "a.spz": splat_files.write_spz,
        "four.spz": partial(splat_files.write_spz, version=4),
        "a.sog": splat_files.bundle_sog,
        "a.ksplat": splat_files.write_ksplat,
    }
    writers[name](folder / name, splat_files.some_splats(60))


KINDS: dict[str, Kind] = {
    "transforms": Kind(lambda at: write_transforms(at / "scan"), ("scan/transforms.json",), _train("scan")),
    "colmap-text": Kind(lambda at: _colmap(at, False), ("scan/sparse/0/*",), _train("scan")),
    "colmap-binary": Kind(lambda at: _colmap(at, True), ("scan/sparse/0/*",), _train("scan")),
    **{
        f"mesh-{name}": Kind(partial(_mesh, name=name), (name, "*.mtl", "*.bin"), _info_mesh(name))
        for name in ("a.glb", "a.gltf", "a.obj", "a.ply", "a.stl", "a.dae")
    },
    "mesh-text.ply": Kind(_ascii_mesh, ("a.ply",), _info_mesh("a.ply")),
    **{
        f"splats-{name}": Kind(partial(_splats, name=name), (name,), _import(name))
        for name in ("a.ply", "a.compressed.ply", "a.splat", "a.spz", "four.spz", "a.sog", "a.ksplat")
    },
    **{
        f"field-{form}": Kind(partial(_fields, form=form), ("place.npz",), command)
        for form, command in (("voxels", _info_with_picture), ("bricks", _info_with_picture), ("neural", _info))
    },
    **{
        f"robot-{body}": Kind(
            partial(_robot, body=body), {"mesh": ("*.stl",), "urdf": ("*.urdf",)}.get(body, ("*.yaml",)), _plan,
            ("m across",),
        )
        for body in _BODIES
    },
    **{f"camera-{name}": Kind(partial(_camera, name=name), (name,), _localize(name)) for name in _CAMERAS},
    "plan": Kind(
        _plan_folder, ("plan/trajectory.json",),
        _export("plan", "csv", "json", "tum", "px4", "crazyflie", "mcap", "gltf"),
    ),
    "flight": Kind(
        _flight, ("flight/*.json", "flight/*.jsonl", "flight/pictures/*"),
        _export("flight", "csv", "json", "tum-estimate", "px4-odometry", "mcap", "gltf", "html"),
    ),
    "tum": Kind(_tum, ("scan/rgb.txt", "scan/rgb/*"), _track("scan")),
    "euroc": Kind(_euroc, ("scan/mav0/*/*.csv", "scan/mav0/*/*.yaml"), _track("scan", "--imu")),
    **{
        f"bag-{form}": Kind(partial(_bag, form=form), ("scan.mcap", "scan/*"), _track(source))
        for form, source in (("scan.mcap", "scan.mcap"), ("sqlite", "scan"), ("mcap", "scan"))
    },
    **{f"video-{name}": Kind(partial(_video, name=name), (name,), _track(name)) for name in ("a.mp4", "a.avi")},
}  # fmt: skip
"""Name to kind."""
