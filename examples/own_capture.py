"""Your own capture: a folder of photographs with transforms.json becomes a field that can be planned in.

Point `import_capture` at your folder (nerfstudio, instant-ngp, Blender or COLMAP); here one is written first.
"""

import argparse
import json
import tempfile
from pathlib import Path

import torch
from PIL import Image

import nerfnav
import nerfnav_scenes as scenes
from nerfnav.importers.captures.config import ImportConfig
from nerfnav.importers.captures.importer import import_capture
from nerfnav.world.capture import CaptureConfig, capture


def write_capture(folder: Path, images: int) -> None:
    """Photograph the scene `blocks` and write the pictures with where they were taken from (camera to world)."""
    config = CaptureConfig(images=images, width=100, height=100)
    *_, last = capture(scenes.load("blocks"), config, torch.Generator().manual_seed(0))
    assert last.captured is not None, "the last step of a capture has all photographs"
    camera, frames = last.captured.camera, []
    for index, picture in enumerate(last.captured.images):
        name, matrix = f"{index:03}.png", torch.eye(4)
        matrix[:3, :3], matrix[:3, 3] = last.captured.poses.rotation[index], last.captured.poses.position[index]
        Image.fromarray(picture.numpy()).save(folder / name)
        frames.append({"file_path": name, "transform_matrix": matrix.tolist()})
    lens = {"w": 100, "h": 100, "fl_x": camera.fx, "fl_y": camera.fy, "cx": camera.cx, "cy": camera.cy}
    (folder / "transforms.json").write_text(json.dumps(lens | {"frames": frames}))


def main(images: int, iterations: int) -> None:
    """Write, read, train, and save the field beside the photographs."""
    with tempfile.TemporaryDirectory() as name:
        folder, generator = Path(name), torch.Generator().manual_seed(0)
        write_capture(folder, images)
        *_, read = import_capture(folder, ImportConfig())
        taken = read.capture
        assert taken is not None, "the last step of an import has the capture"
        print(f"{taken.report.images_used} photographs, {taken.report.images_held_out} of them held out to judge by")
        print(f"box: {taken.box.describe()}; guessed: {'; '.join(taken.report.guesses)}")
        config = nerfnav.TrainConfig(voxel=0.05, iterations=iterations)
        *_, step = nerfnav.train(taken.learned, taken.held_out, taken.box, taken.background, config, generator)
        assert step.field is not None, "the last step of a training has the field"
        size = nerfnav.save_field(step.field, folder / "place.npz")
        print(f"trained: {step.psnr_db:.1f} dB on held-out views after {step.field.info.train_s:.0f} s, {size} bytes")
        nerfnav.load_field(folder / "place.npz")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--images", type=int, default=40, help="photographs to take")
    parser.add_argument("--iterations", type=int, default=120, help="training steps; 2,000 for a field to fly in")
    arguments = parser.parse_args()
    main(arguments.images, arguments.iterations)
