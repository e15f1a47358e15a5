"""A surface that is shown in its colours first, and with its texture once nothing else is to be done."""

from dataclasses import replace
from pathlib import Path

import pytest

from nerfnav.core.glb import parts
from nerfnav.core.steps import yield_result
from nerfnav_app.jobs.open.opening import run
from nerfnav_app.places.place import open_place
from nerfnav_app.queries.query import Resources
from nerfnav_app.queries.surface_texture import SurfaceTextureQuery
from nerfnav_app.reducers.root import reduce
from nerfnav_app.state import actions as m
from nerfnav_app.state.job import JobKind
from nerfnav_app.state.session import Session
from tests.app.sessions import after, reports


@pytest.fixture
def seen(field_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Session:
    """A session whose place can be seen for the first time on this machine."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    session = Session.opening(str(field_file))
    for event in run(session.what):
        session = replace(reports(session, event), seeking=False)
        if session.surface is not None:
            return session
    raise AssertionError("nothing was shown")


@pytest.mark.slow
def test_a_surface_is_shown_in_its_colours_until_its_texture_is_made(seen: Session, field_file: Path) -> None:
    rough = seen.surface
    assert rough is not None and seen.may_begin, "nobody waits for the texture"
    assert "COLOR_0" in parts(rough)[0]["meshes"][0]["primitives"][0]["attributes"]
    place = open_place(str(field_file))
    (query,) = SurfaceTextureQuery.pending(seen)
    *steps, baked = yield_result(query.steps(Resources(place)))
    assert len(steps) > 3, "a hand would wait for it"
    textured = after(seen, m.QueryAnswered(query, baked))
    assert not list(SurfaceTextureQuery.pending(textured))
    assert textured.surface is not None and "images" in parts(textured.surface)[0]
    again = Session.opening(str(field_file))
    for event in run(again.what):
        again = reports(again, event)
        if again.surface is not None:
            break
    assert again.surface == textured.surface and not again.surface_is_rough, "it was kept"


def test_plans_do_not_wait_for_the_texture(seen: Session) -> None:
    planning = reduce(seen, m.StartPlan())
    assert planning.job is not None and planning.job.kind is JobKind.PLAN
    assert not list(SurfaceTextureQuery.pending(planning))
    assert list(SurfaceTextureQuery.pending(reduce(planning, m.Cancel())))


def test_a_texture_of_another_place_is_not_taken(seen: Session) -> None:
    (query,) = SurfaceTextureQuery.pending(seen)
    elsewhere = replace(seen, surface=b"another")
    assert after(elsewhere, m.QueryAnswered(query, b"late")).surface == b"another"
