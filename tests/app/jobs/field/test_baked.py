"""A mesh becomes a field without training: by the command, and in the page, where it is refined afterwards."""

import json
from dataclasses import replace
from itertools import takewhile
from pathlib import Path

import pytest

from nerfnav.core.glb import parts
from nerfnav.field.models.voxel import VoxelField
from nerfnav.field.storage.checkpoint import load_field
from nerfnav.importers.meshes.config import SceneConfig
from nerfnav_app.cli.main import BAD_INPUT, main
from nerfnav_app.jobs.events import PlaceOpened, Progress, SurfaceShaped
from nerfnav_app.jobs.field import baked
from nerfnav_app.jobs.field.baked import refine
from nerfnav_app.jobs.fly import fly
from nerfnav_app.jobs.fly.request import FlyRequest
from nerfnav_app.jobs.open import make_field
from nerfnav_app.jobs.open.opening import run
from nerfnav_app.jobs.plan.plan import PlanRequest
from nerfnav_app.places.place import open_place
from nerfnav_app.places.surface_glb import read_box
from nerfnav_app.queries.better_field import BetterFieldQuery
from nerfnav_app.queries.query import Resources
from nerfnav_app.state import actions as m
from nerfnav_app.state.session import Session
from tests.app.jobs.field.test_meshes import pillars
from tests.app.sessions import after, reports

PLACED = ("--up", "0", "0", "1", "--scale", "1", "--voxel", "0.05")


def test_the_command_bakes_a_mesh_and_says_how_it_was_made(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = tmp_path / "pillars.npz"
    assert main(["train", str(pillars(tmp_path)), "--out", str(out), "--baked", "--json", *PLACED]) == 0
    told = json.loads(capsys.readouterr().out)
    assert told["proven_from"] == told["learned_from"] == "mesh" and told["psnr_db"] > 20
    assert told["geometry"]["surface_taken_for_free"] < 0.01 and told["geometry"]["free_taken_for_free"] > 0.9
    info = load_field(out).info
    assert (info.made_by, info.iterations, info.source) == ("baked", 0, "pillars.ply")
    assert info.noise_std is not None and info.position_floor_m is not None
    assert open_place(str(out)).scene is not None


@pytest.mark.parametrize(
    ("words", "reported"),
    [
        (["--budget", "5"], "budget means nothing for a baked mesh"),
        (["--iterations", "5"], "iterations means nothing for a baked mesh"),
        (["--field", "neural"], "field means nothing for a baked mesh"),
        (["--depth", "off"], "depth means nothing for a baked mesh"),
    ],
)
def test_options_of_training_are_refused(
    words: list[str], reported: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "f.npz"
    assert main(["train", str(pillars(tmp_path)), "--out", str(out), "--baked", *words]) == BAD_INPUT
    assert reported in capsys.readouterr().err and not out.exists()


@pytest.mark.parametrize("source", ["stonehenge", "missing.glb"])
def test_what_is_no_mesh_is_not_baked(source: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["train", source, "--out", str(tmp_path / "f.npz"), "--baked"]) == BAD_INPUT
    assert len(capsys.readouterr().err.strip().splitlines()) == 1


@pytest.fixture
def opened(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Session:
    """A session in which a small mesh was opened, without its surface's texture."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setattr(SceneConfig, "nodes", 1e5)
    monkeypatch.setattr(baked, "images_for", lambda volume: 30)
    session = Session.opening(str(pillars(tmp_path)))
    for event in run(session.what):
        session = reports(session, event)
        if isinstance(event, SurfaceShaped) and session.place is None:
            assert session.surface is not None and read_box(session.surface) is not None, "the mesh is seen at once"
            assert "COLOR_0" in parts(session.surface)[0]["meshes"][0]["primitives"][0]["attributes"]
        elif isinstance(event, SurfaceShaped):
            return replace(session, seeking=False, surface_is_rough=False)
    raise AssertionError("nothing was opened")


def test_a_mesh_is_seen_before_its_field_is_made(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(SceneConfig, "nodes", 1e5)
    events = [event for event in run(str(pillars(tmp_path))) if isinstance(event, SurfaceShaped | PlaceOpened)]
    assert [type(event) for event in events] == [SurfaceShaped, PlaceOpened, SurfaceShaped]
    assert events[2] is events[0], "it stays until the field's surface has its texture"
    found = make_field.find_made_field(tmp_path / "pillars.ply")
    assert found is not None and load_field(found).info.made_by == "baked"


@pytest.mark.slow
def test_a_baked_field_is_calibrated_and_learns_its_colours_while_nothing_else_runs(
    opened: Session, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("nerfnav_app.queries.better_field.BUDGETS_S", {"good": 0.3})
    session, seen = opened, []
    ends = session.ends
    assert session.place is not None and session.place.field.info.noise_std is None
    while pending := list(BetterFieldQuery.pending(session)):
        (query,) = pending
        assert session.place is not None
        before = session.place.field
        session = after(session, m.QueryAnswered(query, query.answer(Resources(session.place))))
        assert session.place is not None
        if session.place.field is not before:
            seen.append(session.place.field.info)
            session = replace(session, surface_is_rough=False) if len(seen) == 1 else session
    calibrated, colored = seen
    assert calibrated.noise_std is not None and calibrated.iterations == 0
    assert colored.iterations > 0 and session.surface_is_rough and session.ends == ends
    assert session.notices[-1].title == "Better colours"
    assert session.place is not None and session.place.file is not None
    stored = load_field(session.place.file)
    assert stored.info.iterations == colored.iterations and open_place(str(session.place.file)).scene is not None


def test_plans_come_before_better_colours(opened: Session) -> None:
    planning = after(opened, m.StartPlan())
    assert list(BetterFieldQuery.pending(opened)) and not list(BetterFieldQuery.pending(planning))


@pytest.mark.slow
def test_each_stage_is_told_once(opened: Session, tmp_path: Path) -> None:
    place = opened.place
    assert place is not None and isinstance(place.field, VoxelField) and place.scene is not None
    steps = refine(place.field, place.scene, tmp_path / "f.npz", 0.2)
    fields = [step for step in steps if isinstance(step, VoxelField)]
    assert [field.info.iterations > 0 for field in fields] == [False, True]


@pytest.mark.slow
def test_a_flight_calibrates_a_field_that_was_just_baked_or_comes_from_an_old_file(opened: Session) -> None:
    place, ends = opened.place, opened.ends
    assert place is not None and ends is not None and place.field.info.noise_std is None
    old = replace(place.field.info, noise_std=0.1)
    calibrated = replace(old, information_ratio=1.0, position_floor_m=0.001)
    for info, calibrates in ((place.field.info, True), (old, True), (calibrated, False)):
        where = replace(place, field=replace(place.field, info=info))
        labels = (event.label for event in fly.run(FlyRequest(PlanRequest(ends)), where) if isinstance(event, Progress))
        before = set(takewhile(lambda label: label != "finding a way", labels))
        assert ("calibrating the field by pictures" in before) is calibrates
