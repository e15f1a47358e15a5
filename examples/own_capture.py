"""Train on a capture: turn a folder of photographs with transforms.json into a field to plan in.

Point `import_capture` at your folder (nerfstudio, instant-ngp, Blender or COLMAP). Here, the script writes one first.
"""

import argparse
import json
import tempfile
from pathlib import Path

import torch
from PIL import Image

import nerfnav
import nerfnav_scenes as scenes
from nerfnav.importers import ImportConfig, import_capture
from nerfnav.world import CaptureConfig, MeshRenderer, capture_poses


def write_capture(folder: Path, images: int) -> None:
    """Photograph the scene `blocks`, and write the pictures and their poses T_world_camera."""
    scene, camera = scenes.load("blocks"), nerfnav.Camera.from_fov(100, 100, 90)
    poses = capture_poses(scene, CaptureConfig(images=images, width=100, height=100), torch.Generator().manual_seed(0))
    renderer, frames = MeshRenderer(scene, supersample=2), []
    for index in range(images):
        name, matrix = f"{index:03}.png", torch.eye(4)
        matrix[:3, :3], matrix[:3, 3] = poses.rotation[index], poses.position[index]
        Image.fromarray(renderer.render(camera, poses[index]).image.numpy()).save(folder / name)
        frames.append({"file_path": name, "transform_matrix": matrix.tolist()})
    lens = {"w": 100, "h": 100, "fl_x": camera.fx, "fl_y": camera.fy, "cx": camera.cx, "cy": camera.cy}
    (folder / "transforms.json").write_text(json.dumps(lens | {"frames": frames}))


def main(images: int, iterations: int) -> None:
    """Write, read, train, and save the field beside the photographs."""
    with tempfile.TemporaryDirectory() as name:
        folder, generator = Path(name), torch.Generator().manual_seed(0)
        write_capture(folder, images)
        taken = nerfnav.run_steps(import_capture(folder, ImportConfig()))
        print(f"{taken.report.images_used} photographs, {taken.report.images_held_out} of them held out for evaluation")
        print(f"box: {taken.box.describe()}; guessed: {'; '.join(taken.report.guesses)}")
        config = nerfnav.TrainConfig(voxel=0.05, iterations=iterations)
        steps = nerfnav.train(taken.learned, taken.held_out, taken.box, taken.background, config, generator)
        field = nerfnav.run_steps(steps)
        size = nerfnav.save_field(field, folder / "place.npz")
        print(f"trained: {field.info.psnr_db:.1f} dB on held-out views after {field.info.train_s:.0f} s, {size} bytes")
        nerfnav.load_field(folder / "place.npz")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--images", type=int, default=40, help="number of photographs")
    parser.add_argument("--iterations", type=int, default=120, help="training steps; 2,000 for a field to fly in")
    arguments = parser.parse_args()
    main(arguments.images, arguments.iterations)
