"""Exports of phone apps, written from their public descriptions by other means than they are read.

All are of the ring of cameras of `synthetic`, in ARKit's world, whose y is up: (x, y, z) here is (x, z, -y) there.
"""

import json
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image
from scipy.spatial.transform import Rotation

from tests.importers.captures.synthetic import CAMERA, matrices, picture, ring

Y_UP = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])
"""From the synthetic world, z up, to ARKit's."""


def arkit_poses(count: int = 8) -> np.ndarray:
    """T_world_camera (n, 4, 4) in ARKit's world."""
    return Y_UP @ matrices(ring(count))


def write_jpeg(path: Path, pose: np.ndarray) -> None:
    """What a camera with that pose in the synthetic world sees."""
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.fromarray(picture(CAMERA, pose)).save(path, quality=95)


def write_polycam(folder: Path, corrected: bool = False, **changes: Any) -> Path:
    """keyframes/images and keyframes/cameras; `changes` replace entries of every camera."""
    prefix = "corrected_" if corrected else ""
    for index, (here, there) in enumerate(zip(matrices(ring()), arkit_poses(), strict=True)):
        stem = str(55_000_000 + 1000 * index)
        write_jpeg(folder / "keyframes" / f"{prefix}images" / f"{stem}.jpg", here)
        said = {f"t_{row}{column}": there[row, column] for row in range(3) for column in range(4)}
        said |= {"fx": CAMERA.fx, "fy": CAMERA.fy, "cx": CAMERA.cx, "cy": CAMERA.cy}
        said |= {"width": CAMERA.width, "height": CAMERA.height, "blur_score": 80.0, **changes}
        file = folder / "keyframes" / f"{prefix}cameras" / f"{stem}.json"
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(json.dumps(said))
    return folder


def write_scanner(folder: Path, **changes: Any) -> Path:
    """frame_00000.json and .jpg; every second frame has depth alone."""
    for index, (here, there) in enumerate(zip(matrices(ring()), arkit_poses(), strict=True)):
        matrix = [CAMERA.fx, 0, CAMERA.cx, 0, CAMERA.fy, CAMERA.cy, 0, 0, 1]
        said = {"cameraPoseARFrame": there.reshape(-1).tolist(), "intrinsics": matrix, "frame_index": index, **changes}
        write_jpeg(folder / f"frame_{2 * index:05d}.jpg", here)
        for frame in (2 * index, 2 * index + 1):
            (folder / f"frame_{frame:05d}.json").write_text(json.dumps(said))
    (folder / "info.json").write_text("{}")
    return folder


def write_record3d(folder: Path, exported: bool = False, own_lenses: bool = False, **changes: Any) -> Path:
    """`metadata` with rgbd/, as a .r3d has them, or metadata.json with rgb/, as an export has."""
    poses = []
    for index, (here, there) in enumerate(zip(matrices(ring()), arkit_poses(), strict=True)):
        write_jpeg(folder / ("rgb" if exported else "rgbd") / f"{index}.jpg", here)
        poses.append([*Rotation.from_matrix(there[:3, :3]).as_quat(), *there[:3, 3]])
    said = {"w": CAMERA.width, "h": CAMERA.height, "poses": poses, "fps": 30}
    said["K"] = [CAMERA.fx, 0, 0, 0, CAMERA.fy, 0, CAMERA.cx, CAMERA.cy, 1]
    if own_lenses:
        said["K"] = [1, 0, 0, 0, 1, 0, 1, 1, 1]
        said["perFrameIntrinsicCoeffs"] = [[CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy]] * len(poses)
    (folder / ("metadata.json" if exported else "metadata")).write_text(json.dumps({**said, **changes}))
    return folder


def write_r3d(path: Path) -> Path:
    """A .r3d file: the same as one archive."""
    folder = write_record3d(path.with_suffix(""))
    with zipfile.ZipFile(path, "w") as archive:
        for file in sorted(folder.rglob("*")):
            if file.is_file():
                archive.write(file, file.relative_to(folder))
    return path


CONFIG = """!!python/object:nerfstudio.engine.trainer.TrainerConfig
_target: !!python/name:nerfstudio.engine.trainer.Trainer ''
data: {data}
experiment_name: room
machine: !!python/object:nerfstudio.configs.base_config.MachineConfig
  seed: 42
output_dir: !!python/object/apply:pathlib.PosixPath
- outputs
pipeline: !!python/object:nerfstudio.pipelines.base_pipeline.VanillaPipelineConfig
  datamanager: !!python/object:nerfstudio.data.datamanagers.base_datamanager.VanillaDataManagerConfig
    data: {data}
    dataparser: !!python/object:nerfstudio.data.dataparsers.nerfstudio_dataparser.NerfstudioDataParserConfig
      data: !!python/object/apply:pathlib.PosixPath []
      scale_factor: 1.0
    eval_image_indices: !!python/tuple
    - 0
"""


def write_run(folder: Path, data: tuple[str, ...], transform: np.ndarray | None = None) -> Path:
    """A nerfstudio run folder that names its data by the parts of a path."""
    folder.mkdir(parents=True)
    parts = "!!python/object/apply:pathlib.PosixPath [" + ", ".join(f"'{part}'" for part in data) + "]"
    (folder / "config.yml").write_text(CONFIG.replace("{data}", parts))
    if transform is not None:
        reported = {"transform": transform[:3].tolist(), "scale": 0.37}
        (folder / "dataparser_transforms.json").write_text(json.dumps(reported))
    (folder / "nerfstudio_models").mkdir()
    (folder / "nerfstudio_models" / "step-000029999.ckpt").write_bytes(b"\x80\x02")
    return folder
