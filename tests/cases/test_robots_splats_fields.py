"""Inputs of public bug reports: robots, splats, fields and plans, by the command's own entry."""

import json
import os
import shutil
from pathlib import Path

import numpy as np
import pytest

from nerfnav.importers import load_splats
from nerfnav_app.cli.main import main

CASES = Path(os.environ.get("NERFNAV_TEST_DATA", ".")) / "cases"
pytestmark = pytest.mark.skipif("NERFNAV_TEST_DATA" not in os.environ, reason="NERFNAV_TEST_DATA is not set")
Capture = pytest.CaptureFixture[str]


def refused(words: list[str], capture: Capture) -> str:
    assert main(words) == 2
    said = capture.readouterr().err
    assert said.startswith("nerfnav: ") and len(said.splitlines()) == 1
    return said


@pytest.mark.parametrize(
    ("case", "reason"),
    [
        ("robot-empty-stl", "b.stl: a body's mesh must have triangles"),
        ("robot-far-spheres", "a body must be 0.005 to 5 m long"),
    ],
)
def test_robots_that_are_none_are_refused(case: str, reason: str, capsys: Capture) -> None:
    said = refused(["plan", "stonehenge", "--task", "0", "--robot", str(CASES / case / "r.yaml")], capsys)
    assert reason in said and "r.yaml" in said


@pytest.mark.slow
def test_a_plan_for_thin_spheres_touches_nothing(capsys: Capture) -> None:
    ends = ["--start", "0.254", "0.054", "0.422", "-1.092", "--goal", "-1.119", "0.128", "0.444", "2.447"]
    robot = str(CASES / "robot-thin-spheres" / "ball.yaml")
    assert main(["plan", "church", "--robot", robot, *ends, "--json"]) == 0
    plan = json.loads(capsys.readouterr().out)
    assert plan["mesh_overlap_m3"] == 0 and 0 < plan["safety"]["min_clearance_m"] < 0.03


@pytest.mark.parametrize("case", ["splat-2dgs/a.ply", "splat-rgb-columns/a.ply", "splat-in-zip/gs.zip"])
def test_splats_are_imported(case: str, tmp_path: Path, capsys: Capture) -> None:
    source = tmp_path / Path(case).name
    shutil.copy(CASES / case, source)
    assert main(["import", str(source), "--out", str(tmp_path / "f.npz"), "--voxel", "0.1", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["source"]["splats"] == 250


def test_flat_splats_have_no_thickness_and_columns_of_bytes_are_colours() -> None:
    flat = load_splats(CASES / "splat-2dgs" / "a.ply")
    thinnest, _, widest = np.linalg.eigvalsh(flat.covariances.astype(np.float64)).T
    assert (thinnest < 1e-4 * widest).all()
    assert np.ptp(flat.centers, axis=0) == pytest.approx([2, 2, 3], abs=0.1)
    coloured = load_splats(CASES / "splat-rgb-columns" / "a.ply")
    np.testing.assert_allclose(coloured.rgbs, np.tile(np.array([200, 100, 50]) / 255, (250, 1)), atol=1e-6)


@pytest.mark.parametrize("command", ["info", "plan", "serve"])
def test_a_damaged_field_is_refused(command: str, capsys: Capture) -> None:
    said = refused([command, str(CASES / "field-damaged" / "a.npz")], capsys)
    assert "a.npz is not a whole nerfnav field, but damaged" in said


@pytest.mark.parametrize("form", ["px4", "json", "csv", "tum", "mcap", "gltf"])
def test_a_plan_with_an_infinite_number_is_refused(form: str, tmp_path: Path, capsys: Capture) -> None:
    plan = str(CASES / "plan-infinity" / "plan")
    said = refused(["export", plan, "--format", form, "--out", str(tmp_path / "o"), "--force"], capsys)
    assert "qx in rows[15] is inf" in said and "trajectory.json" in said and not (tmp_path / "o").exists()
