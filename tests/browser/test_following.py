"""The plan follows the hand, and what is shown is what is flown."""

import time
from collections.abc import Callable, Generator
from typing import Any

import numpy as np
import pytest

from nerfnav_app.page.kit.theme import HIT, PLAN
from nerfnav_app.page.layers.ends import GIZMO
from nerfnav_app.page.panels.status.next_step import find_remedy
from nerfnav_app.page.panels.status.status import needs_confirmation, status
from nerfnav_app.places.ends import EndRole
from nerfnav_app.queries.following_plan import FollowingPlanQuery, SessionPlan, make_plan, plan_request
from nerfnav_app.queries.query import Resources
from nerfnav_app.server import App
from nerfnav_app.state.actions import Adjust, Settings
from tests.browser.tab import Tab
from tests.browser.works import small_work

Serve = Callable[..., App]
OpenTab = Callable[[App], Tab]

_LEAST_SHARE, _MOST_STAGES = 0.2, 8.0
"""Updates of the line, as a share of those for which there was time, and how many times as long as a move, a draft and
a frame take together the line may be behind: bounds in seconds would judge what else the machine does."""
_HZ, _SECONDS = 20, 4

# at each frame: time [ms], x of the goal's gizmo and of the plan's last point
_RECORD = """
() => {
  window.__followed = [];
  const record = now => {
    const line = window.__viserSceneTree.getState()['/plan/line'].message.props.points;
    const points = new Float32Array(line.buffer, line.byteOffset, line.byteLength / 4);
    const goal = window.__viserMutable.nodePoseData['/goal'].position;
    window.__followed.push([now, goal[0], points[points.length - 3]]);
    requestAnimationFrame(record);
  };
  requestAnimationFrame(record);
}
"""

# moves of the mouse from one point of the screen to another, so many a second for so many seconds
_MOVES = """
async ([x0, y0, x1, y1, hz, seconds]) => {
  const canvas = window.__viserMutable.canvas, began = performance.now(), count = hz * seconds;
  for (let k = 1; k <= count; k++) {
    await new Promise(done => setTimeout(done, began + 1000 * k / hz - performance.now()));
    const at = {clientX: x0 + k / count * (x1 - x0), clientY: y0 + k / count * (y1 - y0)};
    const mouse = {pointerId: 1, pointerType: 'mouse', isPrimary: true, buttons: 1, bubbles: true};
    canvas.dispatchEvent(new PointerEvent('pointermove', {...mouse, ...at}));
  }
}
"""


def drag(tab: Tab, distance: float) -> None:
    """Drag the goal along x as a hand does: as many moves a second as the page sends, for some seconds.

    The page itself makes the moves: a mouse that is moved from here waits for a frame after each.
    """
    grip = tab.position(EndRole.GOAL) + np.array([0.8 * GIZMO, 0, 0])
    begin, end = (tab.resting(point) for point in (grip, grip + np.array([distance, 0, 0])))
    mouse = tab.page.mouse
    mouse.move(*begin)
    tab.until_drawn()
    mouse.down()
    tab.page.evaluate(_MOVES, [*begin, *end, _HZ, _SECONDS])
    mouse.move(*end)
    mouse.up()


def timed_drafts(monkeypatch: pytest.MonkeyPatch) -> list[float]:
    """How long each draft takes that is made from now on [s]."""
    steps, took = FollowingPlanQuery.steps, []

    def timed(query: FollowingPlanQuery, resources: Resources) -> Generator[None, None, SessionPlan]:
        began = time.monotonic()
        plan = yield from steps(query, resources)
        if query.record.draft:
            took.append(time.monotonic() - began)
        return plan

    monkeypatch.setattr(FollowingPlanQuery, "steps", timed)
    return took


def lags(frames: Any) -> tuple[int, int, np.ndarray, np.ndarray]:
    """How often the gizmo moved and the line's end changed; how long each frame took, and how far behind it was [s]."""
    now, hand, end = np.array(frames, dtype=np.float64).T
    now = now / 1000
    moving = np.flatnonzero(np.abs(np.diff(hand)) > 1e-6)
    part = slice(moving[0], moving[-1] + 1)
    now, hand, end = now[part], hand[part], end[part]
    done, reached = np.abs(end - hand[0]), np.abs(hand - hand[0])  # it goes one way only
    at = np.minimum(np.searchsorted(reached, done + 1e-4, side="right") - 1, np.arange(len(now)))
    changes = int((np.abs(np.diff(end)) > 1e-6).sum())
    return len(moving), changes, np.diff(now), now - now[at]


def with_field(serve: Serve, open_tab: OpenTab) -> tuple[App, Tab]:
    """An app and a tab of it with a plan."""
    app = serve(small_work())
    tab = open_tab(app)
    tab.press("status.next.start_plan")
    tab.until_planned()
    return app, tab


def test_the_plan_follows_the_hand_and_ends_as_good_as_one_from_scratch(
    serve: Serve, open_tab: OpenTab, monkeypatch: pytest.MonkeyPatch
) -> None:
    app, tab = with_field(serve, open_tab)
    tab.until(lambda: tab.is_visible("/plan/line"), "no plan is shown")
    tab.page.evaluate(_RECORD)
    before, drafts = app.session.ends.goal.position[0], timed_drafts(monkeypatch)
    drag(tab, -0.35)
    frames = tab.page.evaluate("window.__followed")
    tab.until_ends_agree()
    assert before - app.session.ends.goal.position[0] > 0.25, "the goal was not dragged"
    assert drafts, "no draft was made"
    moves, changes, each, behind = lags(frames)
    possible = min(moves, each.sum() / np.mean(drafts))
    draft_s, frame_s, behind_s = (np.percentile(lasted, 95) for lasted in (drafts, each, behind))
    stages_s = 1 / _HZ + draft_s + frame_s
    told = (
        f"{changes} of {possible:.0f} updates in {each.sum():.1f} s, {behind_s:.3f} s behind the hand; "
        f"drafts take {draft_s:.3f} s, frames {frame_s:.3f} s (p95)"
    )
    print(told)
    assert changes >= _LEAST_SHARE * possible and behind_s <= _MOST_STAGES * stages_s, told
    tab.until(lambda: app.session.fresh_plan is not None, "no plan with a verdict was made at the end")
    session = app.session
    plan, place = session.plan, session.place
    assert plan is not None and plan.latest is not None and place is not None
    drawn = plan.latest.motion.states.position.numpy()
    assert "safety" in plan.summary, "nobody has judged it"
    scratch = make_plan(plan_request(session.new_plan(session.ends), Resources(place)), place)
    assert plan.latest.cost.total <= 1.02 * scratch.steps[-1].cost.total
    tab.until(lambda: tab.says("Planned: "), "the page does not say how good it is")
    tab.until(lambda: tab.shows("/plan/line", drawn), "another plan is shown")


def test_another_duration_is_planned_for_and_too_little_time_is_told_with_its_remedy(
    serve: Serve, open_tab: OpenTab
) -> None:
    app, tab = with_field(serve, open_tab)
    app.post(Adjust(Settings.PLAN, "duration_s", 0.8))
    too_fast = lambda: app.session.unsafe_plan and tab.says(status(app.session).text)  # noqa: E731
    tab.until(too_fast, "the page does not say that it is too fast")
    tab.until(lambda: tab.property("/plan/line", "colors") == list(HIT), "it looks as if it could be flown")
    tab.until(lambda: find_remedy(app.session) is not None, "no remedy is offered")
    tab.until_shown()
    allow = tab.button("status.next.allow_time")
    allow.wait_for()
    assert tab.page.locator(".mantine-Notification-root", has_text="fast").count() == 0, "it is said twice"
    allow.click()
    tab.until(lambda: app.session.fresh_plan is not None, "more time did not help")
    assert app.session.plan_settings.duration_s > 0.8
    tab.until(lambda: tab.property("/plan/line", "colors") == list(PLAN), "a good plan looks as if it were none")
    tab.until(lambda: not tab.button("status.next.allow_time").is_visible(), "the error has outlived its cause")


def test_without_weight_on_collision_fly_asks_first_and_reset_restores_the_weights(
    serve: Serve, open_tab: OpenTab
) -> None:
    app, tab = with_field(serve, open_tab)
    app.post(Adjust(Settings.PLAN, "paper_cost", True))  # else the risk of noise keeps it away
    app.post(Adjust(Settings.WEIGHTS, "collision", 0.0))
    tab.until(lambda: app.session.unsafe_plan is not None, "the plan does not know that it is not safe")
    tab.until(lambda: tab.says(status(app.session).text), "the page does not say what is wrong")
    tab.key("f")
    tab.until(lambda: needs_confirmation(app.session), "no confirmation is asked for")
    tab.button("status.anyway").wait_for()
    assert app.session.job is None and app.session.flight is None
    tab.press("status.decline")
    tab.until(lambda: not tab.button("status.anyway").is_visible(), "it goes on asking")
    tab.key("f")
    tab.press("status.anyway")
    tab.until(lambda: app.session.flight is not None, "it does not fly")
    tab.press("status.reset")
    tab.page.get_by_role("button", name="Reset all", exact=True).click()
    tab.until(lambda: app.session.plan is None and app.session.job is None, "nothing was reset")
    assert app.session.plan_settings.has_default_cost
    tab.until(lambda: not tab.is_visible("/plan/line"), "the plan stays")
