"""The export panel: its three subjects, its refusals, and the names of its files."""

from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest
import viser

from nerfnav.export.formats import FORMATS
from nerfnav.export.recording import Subject
from nerfnav.export.refusal import Refusal, Remedy
from nerfnav.navigation.episode import EpisodeOutcome
from nerfnav.planner import PlanOutcome
from nerfnav.robots.state import Motion
from nerfnav_app.jobs.events import FileMade, JobFinished, TrajectoryRefused
from nerfnav_app.page.panels.runs.export import ExportPanel
from nerfnav_app.places.ends import End, Ends
from nerfnav_app.reducers.root import reduce
from nerfnav_app.state.export_subject import find_outcome, list_subjects, make_recording, name_download
from nerfnav_app.state.flight import FlightRecord
from nerfnav_app.state.job import TrajectoryDownload
from nerfnav_app.state.plan import PlanRecord
from nerfnav_app.state.session import Session
from tests.app.doubles import balls_place, plan_step
from tests.app.sessions import reports
from tests.export.flights import arrived
from tests.waiting import free_port

ENDS = Ends(End((-0.7, 0.0, 0.4)), End((0.7, 0.1, 0.4)))
PLAN = PlanRecord(ENDS).with_step(plan_step(ENDS, 0, PlanOutcome.CONVERGED))


def planned() -> Session:
    return Session("balls", place=balls_place(), ends=ENDS, plan=PLAN)


def motion_of(plan: PlanRecord) -> Motion:
    assert plan.latest is not None
    return plan.latest.motion


def flown(outcome: EpisodeOutcome = EpisodeOutcome.REACHED) -> Session:
    *steps, last = arrived(motion_of(PLAN))
    return replace(planned(), flight=FlightRecord(ENDS, (*steps, replace(last, outcome=outcome))))


class Panel:
    """An export panel with the commands that it posts, and the files that its tab gets."""

    def __init__(self, server: viser.ViserServer) -> None:
        self.posted: list[Any] = []
        self.files: list[str] = []
        self.panel = ExportPanel(server, self.posted.append)

    def show(self, session: Session, format: str) -> Subject:
        self.panel.show(session)
        self.panel._format.value = format
        self.panel.show(session)
        return self.panel._chosen

    def press(self, handler: str) -> None:
        def send_file_download(name: str, content: bytes, save_immediately: bool) -> None:
            self.files.append(name)

        client = SimpleNamespace(client_id=4, send_file_download=send_file_download)
        getattr(self.panel, handler)(SimpleNamespace(client=client))


@pytest.fixture
def panel() -> Iterator[Panel]:
    server = viser.ViserServer(host="127.0.0.1", port=free_port(), verbose=False)
    try:
        yield Panel(server)
    finally:
        server.stop()


def test_the_subject_is_that_of_the_format_and_before_a_flight_the_plan(panel: Panel) -> None:
    assert panel.show(planned(), "csv") is Subject.PLAN
    assert panel.panel._subject.options == ("Plan",)
    found = {name: panel.show(flown(), name) for name in ("csv", "px4", "crazyflie", "tum-estimate", "json")}
    assert found == {name: FORMATS[name].subjects[0] for name in found}
    panel.panel._subject.value = "Estimate"
    assert panel.show(flown(), "json") is Subject.ESTIMATE, "the choice stays"


def test_files_are_named_after_their_subjects(panel: Panel) -> None:
    panel.show(flown(), "csv")
    for label in ("Plan", "Executed path", "Estimate"):
        panel.panel._subject.value = label
        panel.press("_send")
    assert panel.files == ["balls-plan.csv", "balls-executed.csv", "balls-estimate.csv"]
    assert name_download(flown(), "px4", Subject.PLAN) == "balls-plan-px4.csv"


def test_a_refusal_is_shown_with_the_button_that_helps_until_the_next_success(panel: Panel) -> None:
    session = flown()
    panel.show(session, "px4")
    panel.panel._subject.value = "Executed path"
    panel.press("_send")
    (asked,) = panel.posted
    assert asked == TrajectoryDownload("px4", 4, Subject.EXECUTED)
    session = reduce(session, asked)
    refusal = Refusal(Subject.EXECUTED, "px4", "it has the jumps of noise", (Remedy.PLAN, Remedy.SMOOTH))
    session = reports(session, TrajectoryRefused(refusal), JobFinished("export"))
    panel.panel.show(session)
    assert panel.panel._refusal.visible and panel.panel._plan.visible and panel.panel._smooth.visible
    panel.press("_send_plan")
    assert panel.posted[-1] == TrajectoryDownload("px4", 4, Subject.PLAN)
    session = reports(reduce(session, panel.posted[-1]), FileMade("balls-plan-px4.csv", b""), JobFinished("export"))
    panel.panel.show(session)
    panel.panel._subject.value = "Executed path"
    panel.panel.show(session)
    assert not panel.panel._refusal.visible and not panel.panel._plan.visible


def test_a_file_that_needs_no_worker_takes_a_refusal_away_too(panel: Panel) -> None:
    refusal = Refusal(Subject.EXECUTED, "px4", "it has the jumps of noise", (Remedy.PLAN, Remedy.SMOOTH))
    session = reduce(flown(), TrajectoryDownload("px4", 4, Subject.EXECUTED))
    session = reports(session, TrajectoryRefused(refusal), JobFinished("export"))
    panel.show(session, "csv")
    panel.press("_send")
    panel.show(session, "px4")
    panel.panel._subject.value = "Executed path"
    panel.panel.show(session)
    assert panel.files and not panel.panel._refusal.visible


def test_the_ending_that_counts_is_that_of_the_subject() -> None:
    session = flown(EpisodeOutcome.COLLIDED)
    assert find_outcome(session, Subject.EXECUTED) is EpisodeOutcome.COLLIDED
    assert find_outcome(session, Subject.PLAN) is PlanOutcome.CONVERGED
    recording = make_recording(session, Subject.PLAN)
    assert recording is not None and recording.outcome == "converged"


def test_a_plan_after_a_flight_takes_the_place_of_its_first_plan() -> None:
    session = replace(flown(), ends=Ends(ENDS.start, End((0.5, -0.5, 0.4))))
    later = PlanRecord(session.ends).with_step(plan_step(session.ends, 0, PlanOutcome.CONVERGED))
    made = make_recording(replace(session, plan=later), Subject.PLAN)
    assert made is not None and made.position[-1].tolist() == pytest.approx([0.5, -0.5, 0.4])
    assert list_subjects(session) == tuple(Subject)
