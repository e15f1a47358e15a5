"""Fields that are put right by hand, in files."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from nerfnav.core.errors import InvalidInputError
from nerfnav.field.core.info import FieldInfo
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.storage.checkpoint import load_field, save_field
from nerfnav.geometry.similarity import Similarity
from nerfnav.importers.alignment import AlignmentRequest
from nerfnav.importers.core.placement import MeasuredDistance, rotation_to_z
from nerfnav_app.jobs.field.georeference import PlaceRequest, run
from nerfnav_app.jobs.open.import_field import ImportRequest
from nerfnav_app.jobs.open.import_field import run as import_run
from nerfnav_app.places.place import open_place
from nerfnav_app.storage.output_files import OutputError
from tests.app.following import result_of
from tests.field.moves import after, change, freed, likeness, room
from tests.importers.splat_files import ball_of_splats, write_dot_splat

FLOOR = ((0.0, -0.4, 0.0), (-0.4, -0.4, 0.0), (0.1, 0.5, 0.0))


def stored(field: VoxelField, path: Path) -> Path:
    save_field(field, path)
    return path


def test_a_measured_place_is_as_long_as_it_was_measured(tmp_path: Path) -> None:
    field = replace(room(), info=replace(room().info, position_floor_m=0.003))
    path = stored(field, tmp_path / "room.npz")
    correction = AlignmentRequest(measured=MeasuredDistance((0.0, 0.0, 0.0), (0.3, 0.4, 0.0), 1.0))
    summary = result_of(run(PlaceRequest(str(path), correction, tmp_path / "out.npz"))).summary
    now = load_field(tmp_path / "out.npz")
    torch.testing.assert_close(now.box.size, 2 * load_field(path).box.size)
    assert summary["changed"] == ["a metre of before is 2 m now, and the place is 2.4 m long"]
    assert now.info.position_floor_m == pytest.approx(0.006)


def test_a_turn_by_hand_comes_first_and_the_rest_is_measured_after_it(tmp_path: Path) -> None:
    path, out = stored(room(), tmp_path / "room.npz"), tmp_path / "out.npz"
    box = load_field(path).box
    x_up = torch.tensor([[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]).double()
    moved = Similarity(x_up, torch.tensor([0.0, 0.0, 0.5]).double(), 2.0)
    kept = ((-1.5, -0.5, -0.5), (0.5, 0.5, 1.5))
    correction = AlignmentRequest(moved=moved, scale=0.5, box=kept)
    summary = result_of(run(PlaceRequest(str(path), correction, out))).summary
    assert summary["changed"][:2] == [
        f"a metre of before is 2 m now, and the place is {2 * float(box.size.max()):.3g} m long",
        "turned by 90 degrees",
    ]
    whole = Similarity(x_up, torch.tensor([0.0, 0.0, 0.25]).double()).box(box)
    lower, upper = torch.maximum(whole.lower, torch.tensor(kept[0])), torch.minimum(whole.upper, torch.tensor(kept[1]))
    now = load_field(out).box
    torch.testing.assert_close(now.lower, lower, atol=0.05, rtol=0)
    torch.testing.assert_close(now.upper, upper, atol=0.05, rtol=0)


@pytest.mark.parametrize(
    ("request_", "answered"),
    [
        (AlignmentRequest(), ("box",)),
        (AlignmentRequest(moved=change(shift=1.0)), ("box",)),
        (AlignmentRequest(moved=change(scale=2.0)), ("box", "scale")),
        (AlignmentRequest(moved=change((0.1, 0.0, 0.0))), ("box", "up")),
        (AlignmentRequest(scale=2.0, find_floor=True), ("box", "up", "scale")),
    ],
)
def test_only_what_was_set_is_no_guess_any_more(request_: AlignmentRequest, answered: tuple[str, ...]) -> None:
    assert request_.answered == answered


@pytest.mark.slow
@pytest.mark.parametrize("find", [False, True])
def test_a_tilted_place_stands_on_its_floor_and_looks_the_same(find: bool, tmp_path: Path) -> None:
    tilt = change((0.1, -0.06, 0.0), shift=0.3)
    tilted = after(room(), tilt)
    path, out = stored(tilted, tmp_path / "tilted.npz"), tmp_path / "level.npz"
    floor = tuple(map(tuple, tilt(torch.tensor(FLOOR).double()).tolist()))
    correction = AlignmentRequest(find_floor=True) if find else AlignmentRequest(floor=floor)  # type: ignore[arg-type]
    changed = changes(path, correction, out)
    assert any("degrees off" in sentence for sentence in changed)
    normal = tilt.rotation[:, 2]
    offset = float(tilt.translation @ normal)
    level = Similarity(torch.from_numpy(rotation_to_z(normal.numpy())), torch.tensor([0.0, 0.0, -offset]).double())
    now, loaded = load_field(out), load_field(path)
    assert isinstance(now, VoxelField) and isinstance(loaded, VoxelField)
    places = torch.tensor([[x, y] for x in (-0.2, 0.0, 0.2) for y in (-0.3, 0.0, 0.3)])
    below, above = (torch.cat([places, torch.full((9, 1), z)], 1) for z in (-0.05, 0.12 if find else 0.08))
    moved_there = level(tilt(torch.zeros(3).double()))[:2].float()
    below[:, :2] += moved_there
    above[:, :2] += moved_there
    assert (now.density(below) > 5).all() and (now.density(above) < 5).float().mean() > 0.6
    if not find:
        assert likeness(loaded, now, level) > 21 and freed(loaded, now, level)[0] == 0


def changes(path: Path, correction: AlignmentRequest, out: Path) -> list[str]:
    """What the job says has changed."""
    return result_of(run(PlaceRequest(str(path), correction, out))).summary["changed"]


@pytest.mark.slow
def test_splats_are_put_right_and_made_into_voxels_again(tmp_path: Path) -> None:
    write_dot_splat(tmp_path / "moon.splat", ball_of_splats(400))
    field = tmp_path / "moon.npz"
    result_of(import_run(ImportRequest(tmp_path / "moon.splat", field)))
    before = open_place(str(field))
    guesses = before.field.info.guesses
    assert any(guess.startswith("up is") for guess in guesses) and any("1 m" in guess for guess in guesses)
    correction = AlignmentRequest(scale=3.0, up=(0.3, 0.1, 1.0))
    result_of(run(PlaceRequest(str(field), correction, tmp_path / "right.npz")))
    now = open_place(str(tmp_path / "right.npz"))
    assert before.splats is not None and now.splats is not None and len(now.splats) == len(before.splats)
    sizes = [np.ptp(splats.centers, axis=0).mean() for splats in (before.splats, now.splats)]
    assert sizes[1] == pytest.approx(3 * sizes[0], rel=0.1)
    assert not now.field.info.guesses
    assert 2.9 < float(now.field.box.size.max() / before.field.box.size.max()) < 5


def test_ground_truth_of_bundled_scenes_stays_behind_and_says_so(tmp_path: Path) -> None:
    path = stored(replace(room(), info=FieldInfo(source="stonehenge")), tmp_path / "stones.npz")
    changed = changes(path, AlignmentRequest(scale=2.0), tmp_path / "larger.npz")
    assert "plans are not judged" in changed[-1]
    assert open_place(str(tmp_path / "larger.npz")).truth is None


@pytest.mark.parametrize(
    ("correction", "said"),
    [
        (AlignmentRequest(), "nothing is to be changed"),
        (AlignmentRequest(box=((9.0, 9.0, 9.0), (10.0, 10.0, 10.0))), "outside the place"),
    ],
)
def test_what_cannot_be_done_is_said(correction: AlignmentRequest, said: str, tmp_path: Path) -> None:
    path = stored(room(), tmp_path / "room.npz")
    with pytest.raises(InvalidInputError, match=said):
        result_of(run(PlaceRequest(str(path), correction, tmp_path / "out.npz")))
    assert not (tmp_path / "out.npz").exists()


def test_a_field_is_not_written_over_itself(tmp_path: Path) -> None:
    path = stored(room(), tmp_path / "room.npz")
    with pytest.raises(OutputError, match="the field itself"):
        result_of(run(PlaceRequest(str(path), AlignmentRequest(scale=2.0), path)))


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"measured": MeasuredDistance((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), 1.0), "scale": 2.0}, "not both"),
        ({"floor": ((0.0, 0.0, 0.0), (1.0, 0.0, 0.0), (2.0, 0.0, 0.0))}, "on one line"),
        ({"up": (0.0, 0.0, 0.0)}, "up must be a direction"),
        ({"box": ((0.0, 0.0, 0.0), (1.0, 0.0, 1.0))}, "lowest corner"),
    ],
)
def test_wrong_corrections_are_refused(wrong: dict[str, object], said: str) -> None:
    with pytest.raises(InvalidInputError, match=said):
        AlignmentRequest(**wrong)  # type: ignore[arg-type]
