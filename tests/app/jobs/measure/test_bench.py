"""Learning of a capture for given times, as a bench measures it."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
import torch
from PIL import Image

from nerfnav.core.errors import InvalidInputError
from nerfnav.field.render.volume_rendering import render_image
from nerfnav_app.jobs.measure import bench
from nerfnav_app.jobs.measure.arena import open_arena
from nerfnav_app.jobs.measure.bench import BenchRequest, Row, measure_training, picture, save_bench
from tests.app.following import result_of
from tests.field.fields import ball, photographs_of_ball
from tests.importers.captures.synthetic import matrices


def write_blender(folder: Path) -> None:
    """Pictures of a ball, cut out, as Blender's data sets have them: some to learn from, some to judge by."""
    for split, count, turn in (("train", 12, 0.0), ("test", 3, 0.7)):
        views = photographs_of_ball(count, 32, turn)
        (folder / split).mkdir()
        frames = []
        for index, pose in enumerate(matrices(views.poses)):
            seen = render_image(ball(), views.camera, views.poses[index])
            opacity = 255 * (seen.opacity > 0.1)[..., None]
            pixels = torch.cat([views.images[index], opacity.to(torch.uint8)], -1).numpy().astype(np.uint8)
            Image.fromarray(pixels).save(folder / split / f"r_{index}.png")
            frames.append({"file_path": f"./{split}/r_{index}", "transform_matrix": pose.tolist()})
        reported = {"camera_angle_x": math.radians(60), "frames": frames}
        (folder / f"transforms_{split}.json").write_text(json.dumps(reported))


@pytest.mark.slow
def test_a_capture_is_learned_for_each_time_and_judged_on_its_own_test_views(tmp_path: Path) -> None:
    write_blender(tmp_path)
    steps = measure_training(tmp_path, (0.5, 1.0))
    labels = []
    while True:
        try:
            labels.append(getattr(next(steps), "label", ""))
        except StopIteration as end:
            rows = end.value
            break
    assert {f"learning {tmp_path.name} for 0.5 s", f"learning {tmp_path.name} for 1 s"} <= set(labels)
    assert [row["budget_s"] for row in rows] == [0.5, 1.0]
    assert all(row["views"] == 3 and row["iterations"] > 0 and row["psnr_db"] > 10 for row in rows)
    assert all(row["cpu_s"] > 0 for row in rows)


ROWS: list[Row] = [
    {"budget_s": 30.0, "psnr_db": 24.0, "cpu_s": 55.0},
    {"budget_s": 300.0, "psnr_db": 26.5, "cpu_s": 570.0},
]


def test_the_chart_shows_what_was_measured_by_minutes() -> None:
    (axes,) = picture(ROWS, 2).axes
    minutes, psnr = axes.lines[0].get_data()
    assert np.asarray(minutes).tolist() == [0.5, 5.0]
    assert np.asarray(psnr).tolist() == [24.0, 26.5]
    assert {text.get_text() for text in axes.texts} == {"24.0 dB\n55 CPU s", "26.5 dB\n570 CPU s"}
    assert "2 cores" in axes.get_title()


def test_the_chart_is_among_the_files_of_a_bench_that_learned_a_capture(tmp_path: Path) -> None:
    summary = {"training": ROWS, "cores": 2, "quick": True}
    files = save_bench(tmp_path, summary, open_arena("stonehenge"), lambda name: None)
    assert [path.name for path in files] == ["bench.json", "training.png"]
    assert Image.open(tmp_path / "training.png").size[0] > 300


@pytest.mark.parametrize("seconds", [(30.0,), (30.0, 0.0)])
def test_what_cannot_be_learned_is_refused_before_anything_is_measured(
    tmp_path: Path, seconds: tuple[float, ...]
) -> None:
    folder = tmp_path / "capture"
    folder.mkdir()
    if 0 in seconds:
        write_blender(folder)
    steps = bench.run(BenchRequest(capture=folder, seconds=seconds), lambda name: None)
    with pytest.raises(InvalidInputError, match="above 0" if 0 in seconds else "capture"):
        next(iter(steps))


def test_a_bench_of_a_capture_that_is_not_there_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InvalidInputError, match="missing"):
        result_of(bench.run(BenchRequest(capture=tmp_path / "missing"), lambda name: None))
