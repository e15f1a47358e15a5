"""COLMAP models, calibrations, recordings and clocks: the right value of each README, by the entry of the command."""

import json
import os
from pathlib import Path

import pytest
import torch

from nerfnav.formats import read_camera
from nerfnav.geometry import Camera
from nerfnav.live.clock import Stamp, VehicleClock
from nerfnav.tracking.sources.registry import open_source
from nerfnav_app.cli.main import main

pytestmark = pytest.mark.skipif("NERFNAV_TEST_DATA" not in os.environ, reason="NERFNAV_TEST_DATA is not set")
CASES = Path(os.environ.get("NERFNAV_TEST_DATA", ".")) / "cases"
PLAIN = (640, 480, 500.0, 501.0, 320.0, 240.0)
Capture = pytest.CaptureFixture[str]


def train(name: str, folder: Path, capsys: Capture) -> tuple[int, str, str]:
    code = main(["train", str(CASES / name), "--out", str(folder / "f.npz"), "--iterations", "1", "--json"])
    out, err = capsys.readouterr()
    return code, out, err


@pytest.mark.parametrize("name", ["colmap-best-model", "colmap-input-folder", "colmap-unused-camera"])
def test_all_eight_pictures_are_used(name: str, tmp_path: Path, capsys: Capture) -> None:
    code, out, _ = train(name, tmp_path, capsys)
    source = json.loads(out.splitlines()[-1])["source"]
    assert code == 0 and source["images_used"] == 8
    chosen = [guess for guess in source["guesses"] if guess.startswith("model: sparse/1")]
    assert len(chosen) == (name == "colmap-best-model")


@pytest.mark.parametrize(("name", "said"), [
    ("colmap-huge-track", "points3D.bin is cut off"), ("colmap-no-images-bin", "is a COLMAP model without images.bin"),
])  # fmt: skip
def test_a_broken_model_is_one_sentence(name: str, said: str, tmp_path: Path, capsys: Capture) -> None:
    code, out, err = train(name, tmp_path, capsys)
    assert (code, out) == (2, "") and said in err and len(err.strip().splitlines()) == 1


@pytest.mark.parametrize(("file", "camera"), [
    ("camera-camera-model-key/c.yaml", Camera(*PLAIN, (0.1, -0.02, 0.001, 0.002), fisheye=True)),
    ("camera-info-echo/c.yaml", Camera(*PLAIN, (0.1, -0.2, 0.001, 0.002, 0.0))),
    ("camera-kalibr/camchain.yaml", Camera(*PLAIN, (0.1, -0.2, 0.001, 0.002))),
    ("camera-opencv-list/c.yaml", Camera(*PLAIN)),
])  # fmt: skip
def test_each_calibration_is_the_camera_that_it_says(file: str, camera: Camera) -> None:
    assert read_camera(CASES / file) == camera


def test_an_infinite_width_is_one_sentence(tmp_path: Path, capsys: Capture) -> None:
    picture = next((CASES / "track-rgb-tabs" / "rgb").iterdir())
    camera = CASES / "camera-width-inf" / "c.yaml"
    assert main(["localize", "stonehenge", str(picture), "--camera", str(camera), "--json"]) == 2
    err = capsys.readouterr().err
    assert "image_width is inf" in err and "a number at most 65536 is needed" in err
    assert len(err.strip().splitlines()) == 1


@pytest.mark.parametrize("name", ["track-microseconds", "track-rgb-tabs"])
def test_four_pictures_are_a_tenth_of_a_second_apart(name: str) -> None:
    times = torch.tensor([frame.time for frame in open_source(CASES / name).frames()], dtype=torch.float64)
    assert times.tolist() == pytest.approx([1606417097.528152 + 0.1 * index for index in range(4)], abs=1e-6)


def test_a_region_of_interest_moves_the_principal_point() -> None:
    assert open_source(CASES / "bag-roi" / "bag").camera == Camera(96, 72, 80.0, 80.0, 48.0, 36.0)


def test_after_one_wrong_stamp_pictures_are_used_again() -> None:
    clock, used = VehicleClock(), []
    for time in (100.0, 100.1, 1e9, 100.2, 200.0):  # as in live-clock-jump/send.py
        if clock.judge(time) in (Stamp.NEXT, Stamp.RESTARTED):
            clock.use(time)
            used.append(time)
    assert used == [100.0, 100.1, 100.2, 200.0]
