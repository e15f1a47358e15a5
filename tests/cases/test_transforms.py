"""Inputs of public bug reports: transforms.json, captures and their archives, by the command's own entry."""

import json
import os
from pathlib import Path
from typing import Any

import pytest
import torch

from nerfnav.core.steps import run_steps
from nerfnav.formats import read_camera
from nerfnav.importers import ImportConfig, import_capture
from nerfnav.tracking.sources.registry import open_source
from nerfnav_app.cli.main import main

CASES = Path(os.environ.get("NERFNAV_TEST_DATA", ".")) / "cases"
pytestmark = pytest.mark.skipif("NERFNAV_TEST_DATA" not in os.environ, reason="NERFNAV_TEST_DATA is not set")
Capture = pytest.CaptureFixture[str]
PICTURE = CASES / "capture-bom" / "images" / "000.jpg"


def trained(source: Path, folder: Path, capture: Capture) -> dict[str, Any]:
    assert main(["train", str(source), "--out", str(folder / "f.npz"), "--iterations", "1", "--json"]) == 0
    return json.loads(capture.readouterr().out)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("case", "expected"),
    [
        ("capture-angle-with-centre", {"images_used": 8, "camera": [96, 72, 80.0, 80.0, 30.0, 50.0]}),
        ("capture-applied-scale", {"images_used": 8}),
        ("capture-backslash", {"images_used": 8}),
        ("capture-bom", {"images_used": 8}),
        ("capture-depth-hw1", {"images_used": 8, "images_with_depth": 8}),
        ("capture-mask-path", {"images_used": 8, "images_with_mask": 8}),
        ("capture-ngp-depth", {"images_used": 8, "images_with_depth": 8}),
        ("capture-split-names", {"images_used": 8, "images_held_out": 3}),
        ("polycam-appledouble", {"images_used": 8}),
        ("zip-backslash/cap.zip", {"images_used": 8}),
        ("zip-bmp/cap.zip", {"images_used": 8}),
    ],
)
def test_a_capture_is_read_rightly(case: str, expected: dict[str, Any], tmp_path: Path, capsys: Capture) -> None:
    summary = trained(CASES / case, tmp_path, capsys)
    for key, value in expected.items():
        assert summary["source"][key] == pytest.approx(value, abs=1e-6)
    assert summary["input_keys"]["unknown"] == []


def test_an_applied_scale_is_undone(tmp_path: Path, capsys: Capture) -> None:
    summary = trained(CASES / "capture-applied-scale", tmp_path, capsys)
    lower, upper = summary["source"]["box"]
    assert upper[0] - lower[0] == pytest.approx(4.4, abs=0.05)
    assert "applied_scale" in summary["input_keys"]["used"]
    assert main(["info", str(tmp_path / "f.npz"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["input_keys"] == summary["input_keys"]


@pytest.mark.parametrize("case", ["capture-depth-hw1", "capture-ngp-depth"])
def test_depths_are_in_metres(case: str) -> None:
    depth = run_steps(import_capture(CASES / case, ImportConfig())).learned.depth
    assert depth is not None and float(depth[depth > 0].median()) == pytest.approx(2.0, abs=0.1)


def test_masked_pixels_do_not_count() -> None:
    mask = run_steps(import_capture(CASES / "capture-mask-path", ImportConfig())).learned.mask
    assert mask is not None and torch.equal((~mask).sum((1, 2)), torch.full((7,), 900))


@pytest.mark.parametrize(
    ("file", "sentence"),
    [
        ("camera-full-opencv/transforms.json", "more than k1, k2, p1, p2 and k3 is not known here"),
        ("camera-huge-int/t.json", "h is infinite, or too large a number, a number at most 65536 is needed"),
    ],
)
def test_a_camera_that_cannot_be_used_is_one_sentence(file: str, sentence: str, capsys: Capture) -> None:
    assert main(["localize", "stonehenge", str(PICTURE), "--camera", str(CASES / file)]) == 2
    said = capsys.readouterr().err
    assert sentence in said and file in said and said.count("\n") == 1


def test_a_fisheye_is_one() -> None:
    camera = read_camera(CASES / "camera-is-fisheye" / "transforms.json")
    assert camera.fisheye and camera.distortion == (0.1, 0.01, 0.0, 0.0)


@pytest.mark.nightly  # searches the whole place for each of four pictures: half a minute
def test_pictures_without_an_ending_are_tracked(tmp_path: Path, capsys: Capture) -> None:
    source = CASES / "track-capture-no-ending"
    assert main(["track", "stonehenge", str(source), "--out", str(tmp_path / "t"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["frames"] == 4


def test_pictures_without_an_ending_are_read() -> None:
    frames = list(open_source(CASES / "track-capture-no-ending").frames())
    assert len(frames) == 4 and len({frame.picture.shape for frame in frames}) == 1
