"""Places that are put right by hand in the page: where their fields are kept."""

from dataclasses import replace
from pathlib import Path

import pytest

from nerfnav.core.errors import InvalidInputError
from nerfnav.field.storage.checkpoint import load_field, save_field
from nerfnav_app.jobs.events import JobResult
from nerfnav_app.places.library import VARIABLE
from nerfnav_app.places.place import open_place
from nerfnav_app.state.alignment import AlignmentDraft, Correction
from nerfnav_app.state.job import Job, JobKind
from nerfnav_app.state.session import Session
from nerfnav_app.worker.backend import NavigationBackend
from tests.app.doubles import balls_place
from tests.app.following import result_of
from tests.field.moves import room

CROPPED = AlignmentDraft(Correction(crop=((-0.3, -0.3, -0.1), (0.6, 0.6, 0.5))))
JOB = Job(3, JobKind.PLACE)


def applied(session: Session, backend: NavigationBackend) -> JobResult:
    """The result of a crop that is applied."""
    return result_of(backend.begin(replace(session, alignment=CROPPED), JOB))


@pytest.mark.parametrize("inside", [True, False])
def test_a_place_of_the_library_is_kept_there_and_any_other_one_beside_nothing_of_the_users(
    inside: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    library = tmp_path / "library"
    monkeypatch.setenv(VARIABLE, str(library))
    path = (library / "0123456789abcdef" if inside else tmp_path / "mine") / "room.npz"
    path.parent.mkdir(parents=True)
    save_field(room(), path)
    # what was opened was something else, of which the field was made
    backend, session = NavigationBackend(), Session(str(path.with_suffix(".splat")), place=open_place(str(path)))
    out = applied(session, backend).files[0]
    assert out.name == "room.npz" and float(load_field(out).box.upper[2]) == pytest.approx(0.5, abs=0.04)
    assert (out.parent.parent == library) == inside and out.parent != path.parent
    assert (tmp_path in out.parents) == inside
    again = applied(session, backend).files[0]
    assert again.parent != out.parent or not inside
    assert float(load_field(path).box.upper[2]) == pytest.approx(0.8), "the field itself has changed"


def test_a_place_in_memory_is_refused_in_one_sentence() -> None:
    with pytest.raises(InvalidInputError, match="open it from a file"):
        applied(Session("balls", place=balls_place()), NavigationBackend())
