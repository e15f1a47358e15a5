"""nerfstudio's run folders: the data are found, its transform is honoured, and nothing in the configuration is run."""

import json
from pathlib import Path

import numpy as np
import pytest

from nerfnav.importers.captures.formats import is_capture, read_views
from nerfnav.importers.captures.views import CaptureError
from tests.importers.captures.phones import CONFIG, write_run
from tests.importers.captures.synthetic import matrices, ring, write_transforms

TURN = np.array([[0.0, -1, 0, 0.5], [1, 0, 0, -2], [0, 0, 1, 3], [0, 0, 0, 1]])


def test_the_data_of_a_run_are_found_and_moved_into_its_world(tmp_path: Path) -> None:
    write_transforms(tmp_path / "data" / "room")
    run = write_run(tmp_path / "outputs" / "room" / "nerfacto" / "2026-01-01_120000", ("data", "room"), TURN)
    assert is_capture(run) and is_capture(run / "config.yml")
    for path in (run, run / "config.yml"):
        found = read_views(path)
        assert found.kind == "nerfstudio run" and all(view.exists for view in found.views)
        np.testing.assert_allclose([view.pose for view in found.views], TURN @ matrices(ring()), atol=1e-6)


def test_data_that_were_moved_with_their_run_are_found_by_name(tmp_path: Path) -> None:
    write_transforms(tmp_path / "room")
    run = write_run(tmp_path / "run", ("/", "home", "somebody", "captures", "room"))
    np.testing.assert_allclose([view.pose for view in read_views(run).views], matrices(ring()), atol=1e-6)


def test_what_nerfstudio_takes_for_applied_to_colmap_s_data_is_taken_off(tmp_path: Path) -> None:
    applied = np.array([[0.0, 1, 0, 0], [1, 0, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]])
    folder = write_transforms(tmp_path / "room")
    (folder / "colmap" / "sparse" / "0").mkdir(parents=True)
    run = write_run(tmp_path / "run", ("room",), TURN @ applied)
    np.testing.assert_allclose([view.pose for view in read_views(run).views], TURN @ matrices(ring()), atol=1e-6)


def test_data_that_are_not_here_are_one_sentence(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run", ("data", "poster"))
    with pytest.raises(CaptureError, match="was trained from data/poster, which is not here: put that folder beside"):
        read_views(run)
    (run / "config.yml").write_text(CONFIG.replace("{data}", "null"))
    with pytest.raises(CaptureError, match="names no data that it was trained from"):
        read_views(run)


def test_a_configuration_that_names_code_never_runs_it(tmp_path: Path) -> None:
    write_transforms(tmp_path / "room")
    run = write_run(tmp_path / "run", ("room",))
    evil = f"!!python/object/apply:os.system ['touch {tmp_path / 'run_me'}']"
    text = (run / "config.yml").read_text().replace("experiment_name: room", f"experiment_name: {evil}")
    text += "more: !!python/object/new:subprocess.Popen [['false']]\nname: !!python/name:os.system ''\n"
    (run / "config.yml").write_text(text)
    assert len(read_views(run).views) == 8
    assert not (tmp_path / "run_me").exists()


@pytest.mark.parametrize("transform", [[[1, 0, 0]], "none", (3 * np.eye(4))[:3].tolist(), [[float("nan")] * 4] * 3])
def test_a_transform_that_is_none_is_refused(transform: object, tmp_path: Path) -> None:
    write_transforms(tmp_path / "room")
    run = write_run(tmp_path / "run", ("room",))
    (run / "dataparser_transforms.json").write_text(json.dumps({"transform": transform, "scale": 1.0}))
    with pytest.raises(CaptureError, match="no rigid transform of 3 x 4 numbers"):
        read_views(run)


def test_a_configuration_that_was_cut_off_says_so(tmp_path: Path) -> None:
    run = write_run(tmp_path / "run", ("room",))
    text = (run / "config.yml").read_text()
    (run / "config.yml").write_text(text[: text.index("'room'") + 3])
    with pytest.raises(CaptureError, match="cut off or no configuration"):
        read_views(run)
