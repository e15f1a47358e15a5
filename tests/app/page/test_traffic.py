"""What is sent to the pages while something moves: changes of standing nodes and widgets, counted on a real server."""

import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import trimesh
import viser._messages as viser_messages

from nerfnav.navigation.episode import EpisodeOutcome
from nerfnav.planner.steps import PlanOutcome
from nerfnav_app.jobs.events import JobResult, PlaceOpened, Progress, SurfaceShaped
from nerfnav_app.page.layers.field_surface import FieldSurfaceLayer
from nerfnav_app.page_server import page_server
from nerfnav_app.places.surface_glb import encode_textured_glb
from nerfnav_app.server import App
from nerfnav_app.state.actions import StartFlight, StartPlan, Tick
from nerfnav_app.state.job import JobKind
from nerfnav_app.state.session import Session
from tests.app.doubles import ScriptedWork, balls_place, flight_step, plan_step
from tests.field.fields import painted
from tests.waiting import PATIENCE_S, free_port, until

STEPS, BEGIN = 40, 6
NODES = (viser_messages._CreateSceneNodeMessage, viser_messages.RemoveSceneNodeMessage)
WIDGETS = (viser_messages._CreateGuiComponentMessage, viser_messages.GuiRemoveMessage)


def slowly(make: Callable[[Any], Any]) -> Callable[[Any], Any]:
    """A step that takes longer than a frame of the page, so that none is merged with the next."""

    def step(job: Any) -> Any:
        time.sleep(0.06)
        return make(job)

    return step


@pytest.fixture
def go_on() -> threading.Event:
    """Before this is set, jobs do not come further than their first steps."""
    return threading.Event()


@pytest.fixture
def app(go_on: threading.Event) -> Iterator[App]:
    """An app whose plans and flights take a while."""

    def held(job: Any) -> Progress:
        assert go_on.wait(PATIENCE_S), "nobody lets it go on"
        return Progress("held", None)

    flight = [slowly(lambda job, k=k: flight_step(job.ends, k)) for k in range(STEPS)]
    plan = [slowly(lambda job, k=k: plan_step(job.ends, k)) for k in range(STEPS)]
    flight.insert(BEGIN, held)
    plan.insert(BEGIN, held)
    arrived = lambda job: flight_step(job.ends, STEPS, EpisodeOutcome.REACHED)  # noqa: E731
    settled = lambda job: plan_step(job.ends, STEPS, PlanOutcome.CONVERGED)  # noqa: E731
    scripts = {
        JobKind.FLY: [*flight, arrived, JobResult()],
        JobKind.PLAN: [*plan, settled, JobResult({"wall_s": 9.0})],
    }
    app = App("balls", port=free_port(), work=ScriptedWork(scripts))
    app.start()
    until(lambda: app.session.place is not None and app.session.job is None, "the place was not opened")
    yield app
    app.stop()


def sent_while(app: App, command: Any, go_on: threading.Event) -> list[viser_messages.Message]:
    """All that is sent to every page from a job's first steps to its end."""
    assert app._server is not None
    sockets, sent = app._server._websock_server, []
    send = sockets.queue_message
    app.post(command)
    until(lambda: _frames(app) >= BEGIN, "the job did not begin")
    shown = threading.Event()
    app._loop.parts = (*app._loop.parts, _Shown(shown))  # last of all parts: what it saw, the others have shown
    app.post(Tick(0.0))
    assert shown.wait(PATIENCE_S), "the page is not changed any more"

    def note(message: Any) -> None:
        sent.append(message)
        send(message)

    sockets.queue_message = note  # type: ignore[method-assign]
    go_on.set()
    until(lambda: app.session.job is None, "the job did not end")
    sockets.queue_message = send  # type: ignore[method-assign]
    return sent


def _frames(app: App) -> int:
    """How many steps of a flight or a plan the session has."""
    plan = app.session.plan
    return max(app.session.steps_reported, plan.latest.iteration + 1 if plan is not None and plan.latest else 0)


@dataclass(frozen=True)
class _Shown:
    """A part of the page that tells when it is shown."""

    told: threading.Event

    def show(self, session: Session) -> None:
        self.told.set()


@pytest.mark.parametrize("command", [StartFlight(), StartPlan()], ids=["flight", "plan"])
def test_nothing_is_added_again_while_a_job_runs(app: App, command: Any, go_on: threading.Event) -> None:
    sent = sent_while(app, command, go_on)
    counts = Counter(type(message).__name__ for message in sent)
    assert sum(isinstance(message, NODES) for message in sent) == 0, counts
    assert sum(isinstance(message, WIDGETS) for message in sent) == 0, counts
    changes = counts["SceneNodeUpdateMessage"] + counts["GuiUpdateMessage"]
    assert changes > STEPS / 2, f"the page would not see it move: {counts}"
    assert len(sent) < 60 * STEPS, f"more than 60 messages for each step: {counts}"


def test_large_nodes_are_not_sent_again_while_a_robot_flies(app: App, go_on: threading.Event) -> None:
    assert app._server is not None
    for message in sent_while(app, StartFlight(), go_on):
        if isinstance(message, viser_messages.SceneNodeUpdateMessage):
            assert "glb_data" not in message.updates and "vertices" not in message.updates, message.name


def test_a_surface_that_was_shown_before_is_there_at_once_and_not_sent_again_when_the_place_opens() -> None:
    place = balls_place()
    box = place.field.box.lower.tolist(), place.field.box.upper.tolist()
    surface = encode_textured_glb(painted(mesh := trimesh.creation.icosphere(), np.zeros((len(mesh.vertices), 3))), box)
    port = free_port()
    server = page_server("127.0.0.1", port)
    sent: list[viser_messages.Message] = []
    sockets = server._websock_server
    send = sockets.queue_message
    sockets.queue_message = lambda message: (sent.append(message), send(message))[1]  # type: ignore[method-assign]
    begun = FieldSurfaceLayer(server, surface)
    assert _named_field(sent) == 1
    eye = server.initial_camera.position
    shaped = SurfaceShaped(bytes(bytearray(surface)))  # the same, read again
    opening = [PlaceOpened(place), shaped, JobResult()]
    app = App("balls", port=port, work=ScriptedWork({JobKind.OPEN: opening}), begun=begun)
    try:
        app.start()
        until(lambda: app.session.place is not None and app.session.job is None, "the place was not opened")
        until(lambda: "/start" in {getattr(message, "name", None) for message in sent}, "no end was shown")
        assert app.session.surface == surface
        assert _named_field(sent) == 1, "the surface stays as it is"
        assert (server.initial_camera.position == eye).all(), "and is seen from where it was"
    finally:
        app.stop()
        server.stop()


def _named_field(sent: list[viser_messages.Message]) -> int:
    """How often the surface was sent or taken away."""
    changing = (*NODES, viser_messages.SceneNodeUpdateMessage)
    return sum(getattr(message, "name", None) == "/field" for message in sent if isinstance(message, changing))
