"""Jobs that a person begins: a map of the place, whose file is for the tab that asked."""

from dataclasses import replace
from pathlib import Path

import pytest

from nerfnav.core.errors import InvalidInputError
from nerfnav.field.core.info import FieldInfo
from nerfnav.field.train.progress import TrainStep
from nerfnav_app.jobs.events import FileMade, JobFailed, JobFinished, PlaceOpened, Progress, SurfaceShaped
from nerfnav_app.jobs.export.occupancy_map import MapRequest, download
from nerfnav_app.page.panels.place.place import describe_opening
from nerfnav_app.page.panels.status.status import describe_activity
from nerfnav_app.state import actions as m
from nerfnav_app.state.job import Download, JobKind, MapDownload
from nerfnav_app.state.session import Session
from nerfnav_app.state.view import Backdrop
from tests.app.doubles import balls_place
from tests.app.sessions import after, planned, reports
from tests.field.models.test_neural import random_field

VOXELS = MapDownload(".npz", client=3)


def test_the_file_that_a_job_made_is_for_the_tab_that_asked(opened: Session) -> None:
    begun = after(opened, VOXELS)
    assert begun.job is not None and (begun.job.kind, begun.job.request) == (JobKind.MAP, VOXELS)
    made = reports(begun, Progress("looking at all voxels", 0.1), FileMade("balls-map.npz", b"voxels"))
    assert made.download == Download(begun.job.id, 3, "balls-map.npz", b"voxels")
    assert reports(made, JobFinished("map")).job is None


def test_each_map_has_a_number_of_its_own(opened: Session) -> None:
    first = reports(after(opened, VOXELS), FileMade("a", b""), JobFinished("map"))
    second = reports(after(first, VOXELS), FileMade("a", b""), JobFinished("map"))
    assert first.download is not None and second.download is not None
    assert first.download.id != second.download.id


def test_a_map_takes_nothing_away_from_the_plan_and_waits_for_what_runs(opened: Session) -> None:
    before = planned(opened)
    assert after(before, VOXELS).plan is before.plan
    flying = after(before, m.StartFlight())
    refused = after(flying, VOXELS)
    assert refused.job == flying.job and refused.trouble is not None and refused.trouble.title == "Still busy"


def test_a_plan_that_is_asked_for_before_the_place_can_be_seen_is_made_then() -> None:
    opening = reports(Session.opening("balls"), PlaceOpened(balls_place()))
    asked = after(opening, m.StartPlan())
    assert asked.job is not None and asked.job.kind is JobKind.OPEN and asked.trouble is None
    assert describe_activity(asked) != describe_activity(opening), "the page does not mention the plan"
    for seen in (SurfaceShaped(b"a surface"), JobFinished("open")):
        planning = reports(asked, seen)
        assert planning.job is not None and planning.job.kind is JobKind.PLAN
    assert reports(opening, SurfaceShaped(b"a surface"), JobFinished("open")).job is None


def test_learning_says_how_far_it_is_and_no_time_left_of_it_stays_afterwards() -> None:
    opening = reports(Session.opening("room"), Progress("reading photographs", 0.9))
    learning = reports(opening, TrainStep(30, 0.25, 20.0, 1e5, 45.0), Progress("training", 0.25, 44.0))
    assert describe_activity(learning) == "Training 25 %, about 45 s left" and "45 s left" in describe_opening(learning)
    judging = reports(learning, Progress("judging", 0.5))
    assert describe_activity(judging) == "Judging 50 %" and "left" not in describe_opening(judging)


@pytest.mark.parametrize("made_by", ["trained", "imported"])
def test_a_field_with_nothing_to_be_seen_is_told_so_with_a_remedy_that_fits_its_source(made_by: str) -> None:
    place = balls_place()
    info = FieldInfo(made_by=made_by)
    place = replace(place, field=replace(place.field, info=info))  # type: ignore[type-var]
    cameras = SurfaceShaped(b"cameras and points", rough=True)
    told = reports(Session.opening("balls"), cameras, PlaceOpened(place), SurfaceShaped(b""))
    assert told.surface is None and told.trouble is not None and "has no surface" in told.trouble.body
    assert ("pictures" in told.trouble.body) == (made_by == "trained")
    assert told.view_settings.backdrop is Backdrop.RENDER, "an empty scene"


def test_a_field_without_voxels_is_refused_in_one_sentence(opened: Session) -> None:
    with pytest.raises(InvalidInputError, match="bake this one first") as said:
        list(download(random_field(), MapRequest(Path("balls-map.npz"))))
    told = reports(after(opened, VOXELS), JobFailed("map", str(said.value)))
    assert told.job is None and told.download is None
    assert told.trouble is not None and told.trouble.title == "Could not make the map"
