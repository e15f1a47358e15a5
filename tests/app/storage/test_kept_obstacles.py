"""Obstacles of runs: kept in their folders, and placed again where these are opened."""

import json
from dataclasses import replace
from pathlib import Path

import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.obstacles import BoxShape, Obstacle, ObstacleSet, read_obstacles
from nerfnav_app.jobs.fly import fly
from nerfnav_app.jobs.fly.request import FlyRequest
from nerfnav_app.jobs.plan import plan
from nerfnav_app.jobs.plan.plan import PlanRequest
from nerfnav_app.places.ends import End, Ends
from nerfnav_app.places.obstacles import open_with_obstacles
from nerfnav_app.places.place import Place
from nerfnav_app.storage.kept_obstacles import KEPT, keep_obstacles, open_as_kept
from nerfnav_app.storage.output_files import OutputError
from nerfnav_app.storage.run_metadata import RunMetadata
from tests.app.doubles import balls_place
from tests.app.following import result_of

ENDS = Ends(End((-0.8, 0.6, 0.4)), End((0.8, 0.6, 0.4)))


@pytest.fixture
def placed(tmp_path: Path) -> Place:
    path = tmp_path / "given.yaml"
    path.write_text("obstacles: [{name: post, cylinder: {radius: 0.1, height: 1}, position: [0, 0.6, 0.4]}]")
    return open_with_obstacles(balls_place(), path)


def test_plans_and_flights_keep_their_obstacles(placed: Place, tmp_path: Path) -> None:
    for name, job, request in (
        ("plan", plan, PlanRequest(ENDS, steps=30, out=tmp_path / "plan")),
        ("fly", fly, FlyRequest(PlanRequest(ENDS, steps=30), open_loop=True, out=tmp_path / "fly")),
    ):
        result = result_of(job.run(request, placed))
        assert result.summary["obstacles"] == 1 and tmp_path / name / KEPT in result.files
        assert read_obstacles(tmp_path / name / KEPT) == placed.obstacles
        again = open_as_kept(balls_place(), tmp_path / name)
        points = torch.tensor([[0.0, 0.6, 0.4], [0.0, 0.75, 0.4], [0.0, 0.0, 0.3]])
        assert torch.equal(again.field.density(points), placed.field.density(points))
    assert f"--obstacles {tmp_path / 'fly' / KEPT}" in (RunMetadata.load(tmp_path / "fly").command or "")


def test_folders_without_obstacles_open_as_before(placed: Place, tmp_path: Path) -> None:
    place = balls_place()
    keep_obstacles(tmp_path, placed)
    assert keep_obstacles(tmp_path, place) == () and not (tmp_path / KEPT).exists()
    assert open_as_kept(place, tmp_path) is place
    result_of(plan.run(PlanRequest(ENDS, steps=30, out=tmp_path), place))
    assert "obstacles" not in json.loads((tmp_path / "plan.json").read_text())


def test_a_damaged_file_and_a_folder_that_is_none_are_one_sentence(placed: Place, tmp_path: Path) -> None:
    (tmp_path / KEPT).write_text("{")
    with pytest.raises(InvalidInputError, match="obstacles"):
        open_as_kept(balls_place(), tmp_path)
    (tmp_path / "file").write_text("")
    box = replace(placed, obstacles=ObstacleSet((Obstacle("a", BoxShape((1, 1, 1)), (0, 0, 0)),)))
    with pytest.raises(OutputError, match="cannot write the obstacles into"):
        keep_obstacles(tmp_path / "file", box)
