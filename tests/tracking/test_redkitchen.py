"""A hand-held camera in a real kitchen: a field of every third frame follows the frames between."""

import json
import os
from pathlib import Path

import numpy as np
import pytest
import torch

from nerfnav.export.track import OPENCV, pose_in_frame
from nerfnav.field import load_field
from nerfnav.geometry import Camera, so3
from nerfnav.geometry.similarity import Similarity
from nerfnav.tracking import Frame, Tracker, TrackerConfig
from nerfnav_app.cli.main import main
from nerfnav_app.jobs.track.camera import read_image

CAMERA = Camera(640, 480, 525.0, 525.0, 320.0, 240.0)
FRAMES = 25


@pytest.mark.slow
@pytest.mark.skipif("NERFNAV_TEST_DATA" not in os.environ, reason="NERFNAV_TEST_DATA does not say where files are")
def test_frames_between_those_that_a_field_learned_are_followed_and_their_covariance_is_honest(tmp_path: Path) -> None:
    folder = Path(os.environ["NERFNAV_TEST_DATA"]) / "redkitchen"
    told = json.loads((folder / "transforms.json").read_text())
    third = [{**frame, **_absolute(frame, folder)} for frame in told["frames"][::3]]
    (tmp_path / "transforms.json").write_text(json.dumps({**told, "frames": third}))
    assert main(["train", str(tmp_path), "--out", str(tmp_path / "field.npz"), "--budget", "30", "--json"]) == 0
    field = load_field(tmp_path / "field.npz")
    assert len(field.info.pose_floor) == 36
    frame = Similarity.of_numbers(field.info.placed).inverted()
    tracker, errors, nees = Tracker(field, CAMERA, config=TrackerConfig().for_field(field.info)), [], []
    for index in [number for number in range(40, 150) if number % 3][:FRAMES]:
        entry = told["frames"][index]
        picture = read_image(folder / entry["file_path"])
        tracked = tracker.observe(Frame(entry["time_s"], picture, entry["file_path"]))
        if tracked.status.updated:
            found, covariance = pose_in_frame(tracked, frame)
            true = torch.tensor(entry["transform_matrix"], dtype=torch.float64)
            moved = true[:3, 3] - found.position
            turned = so3.log(true[:3, :3] @ OPENCV.double() @ found.rotation.T)
            error = torch.cat([moved, turned])
            errors.append(float(moved.norm()))
            nees.append(float(error @ torch.linalg.solve(covariance, error)))
    assert len(errors) > 0.8 * FRAMES
    assert np.median(errors) < 0.06 and np.mean(nees) < 15


def _absolute(frame: dict[str, str], folder: Path) -> dict[str, str]:
    return {name: str(folder / frame[name]) for name in ("file_path", "depth_file_path")}
