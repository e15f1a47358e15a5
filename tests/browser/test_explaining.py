"""What the page explains: events on the timeline, settings on their names; and keys after a click."""

from collections.abc import Callable
from dataclasses import replace

from nerfnav.navigation.episode import EpisodeOutcome
from nerfnav_app.jobs.events import JobResult
from nerfnav_app.page.layers.shapes import tube
from nerfnav_app.queries.clearance import ClearanceQuery
from nerfnav_app.server import App
from nerfnav_app.state.job import JobKind
from tests.app.doubles import ScriptedWork, flight_step
from tests.browser.tab import Tab
from tests.browser.works import small_work

Serve = Callable[..., App]
OpenTab = Callable[[App], Tab]
_NAME = "label:text-is('{}')"
_BLOWN = 5
"""Time step of the gust."""
_HOVERED = """dot => {
  const {x, y, width, height} = dot.getBoundingClientRect();
  return document.elementFromPoint(x + width / 2, y + height / 2)?.closest("[title]")?.title;
}"""
"""Reads the tooltip that a hand over the middle of an element sees."""


def test_space_pauses_after_a_click_on_a_tab_and_a_flight_is_in_real_time(serve: Serve, open_tab: OpenTab) -> None:
    steps = [lambda job, k=k: flight_step(job.ends, k) for k in range(400)]
    app = serve(ScriptedWork({JobKind.FLY: [*steps, JobResult()]}))
    tab = open_tab(app)
    tab.key("f")
    tab.until(lambda: app.session.steps_reported > 3, "nothing flies")
    tab.turn_to("Estimate")
    tab.turn_to("Fly")
    tab.key(" ")
    tab.until(lambda: app.session.job is not None and app.session.job.paused, "space does not pause")
    assert app.session.steps_reported < 200, "it flies as fast as it can"
    tab.press("flight.steer", "Resume")
    tab.until(lambda: app.session.job is not None and not app.session.job.paused, "it does not go on")
    tab.key(" ")
    tab.until(lambda: app.session.job is not None and app.session.job.paused, "space does not pause after a button")


def test_marks_of_events_are_tooltips_and_their_names_are_below(serve: Serve, open_tab: OpenTab) -> None:
    steps = [
        lambda job, k=k: replace(flight_step(job.ends, k), gust_mps=0.1 if k == _BLOWN else None) for k in range(40)
    ]
    last = lambda job: flight_step(job.ends, 40, EpisodeOutcome.REACHED)  # noqa: E731
    app = serve(ScriptedWork({JobKind.FLY: [*steps, last, JobResult()]}))
    tab = open_tab(app)
    tab.key("f")
    tab.until(lambda: app.session.steps_reported > 1, "nothing flies")
    tab.until_idle()
    mark = tab.page.locator(".mantine-Slider-markWrapper[title^='Gust at']")
    mark.wait_for(state="attached")  # it has no size of its own: what is hovered over is the dot in it
    tab.until(
        lambda: mark.locator(".mantine-Slider-mark").evaluate(_HOVERED) == mark.get_attribute("title"), "it is covered"
    )
    assert mark.locator(".mantine-Slider-markLabel").evaluate("label => getComputedStyle(label).visibility") == "hidden"
    listed = tab.page.locator("span[title='the robot was pushed once']")
    assert listed.inner_text().startswith("gust ")


def test_the_hint_of_a_setting_is_on_its_name_too_and_a_greyed_button_says_why(serve: Serve, open_tab: OpenTab) -> None:
    tab = open_tab(serve(ScriptedWork()))
    tab.turn_to("Plan")
    tab.page.locator(_NAME.format("Duration [s]")).hover()
    tab.page.locator("[role=tooltip]:has-text('From start to goal')").wait_for()
    tab.turn_to("Estimate")
    tab.until(lambda: tab.says("needs a camera picture"), "the button does not say why it is greyed out")


def test_the_room_for_noise_is_drawn_around_a_plan_that_rests_and_can_be_switched_off(
    serve: Serve, open_tab: OpenTab
) -> None:
    app = serve(small_work())
    tab = open_tab(app)
    tab.press("status.next.start_plan")
    tab.until_planned()
    tab.until(lambda: tab.is_visible("/plan/margin"), "the room is not drawn")
    known, session = ClearanceQuery.result_shown(app.session), app.session
    assert known is not None and known.deviations is not None
    assert session.plan is not None and session.plan.latest is not None and session.place is not None
    centers = session.plan.latest.motion.states.position.numpy()
    drawn = tube(centers, session.place.robot.body.radius, known.deviations)
    assert len(tab.property("/plan/margin", "vertices")) == drawn.vertices.size
    tab.turn_to("Plan")
    tab.box("plan.margin").click()
    tab.until(lambda: not tab.is_visible("/plan/margin"), "it stays")
