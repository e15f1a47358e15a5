"""A person puts something in the way, drags it, lets it move, and takes it away again."""

from collections.abc import Callable

import numpy as np

from nerfnav.field import UnknownSpace
from nerfnav.robots import Motion
from nerfnav_app.page.layers.obstacles import HANDLES, SIZES
from nerfnav_app.places.ends import End, EndRole
from nerfnav_app.queries.placed_obstacles import PlacedObstaclesQuery
from nerfnav_app.server import App
from nerfnav_app.state.actions import Adjust, MoveEnd, Settings, StartPlan
from nerfnav_app.state.obstacles import ChangeObstacle, GizmoMode, ObstacleKind, PlacedObstacle
from nerfnav_app.state.session import Session
from nerfnav_app.worker.backend import NavigationBackend
from tests.browser.in_page import POSITION
from tests.browser.tab import Tab
from tests.browser.test_following import with_field
from tests.browser.works import calm_flights

Serve = Callable[..., App]
OpenTab = Callable[[App], Tab]
TOP_OF_BALL = (0.0, 0.0, 0.5)
"""Point of the first ball, between start and goal [m]."""
HALF_HEIGHT = 0.02
"""Of the robot [m]."""


def add_box(tab: Tab, at: tuple[float, float, float]) -> PlacedObstacle:
    """Drop a box where a click meets something."""
    count = len(tab.app.session.obstacles)
    tab.press("obstacles.add", "box")
    tab.until(lambda: tab.app.session.aiming is not None, "the page does not wait for a click")
    tab.click_at(at)
    tab.until(lambda: len(tab.app.session.obstacles) > count, "no box was dropped")
    tab.until_shown()
    tab.until(lambda: tab.is_visible(HANDLES), "it has no handles")
    return tab.app.session.obstacles[-1]


def drag_box(tab: Tab, axis: int, distance: float) -> None:
    """Drag the arrow of the chosen obstacle along an axis [m]."""
    placed = tab.app.session.chosen_obstacle
    assert placed is not None
    size = float(np.diff(placed.obstacle.span(np.eye(3)), axis=0).max())
    tab.until_shown()
    at, along = np.array(tab.page.evaluate(POSITION, HANDLES)), np.eye(3)[axis]
    grip = at + 0.8 * SIZES[GizmoMode.MOVE] * size * along
    tab.drag(grip, grip + distance * along)
    tab.until(lambda: not tab.app.session.held, "the hand does not let go")


def drag_box_to(tab: Tab, point: np.ndarray) -> None:
    """Drag the chosen obstacle to a point, along one axis after the other [m]."""
    for axis in range(3):
        placed = tab.app.session.chosen_obstacle
        assert placed is not None
        distance = float(point[axis] - placed.entry.position[axis])
        if abs(distance) > 0.04:
            drag_box(tab, axis, distance)


def gap(session: Session, motion: Motion) -> float:
    """Distance of a motion's middle line from the obstacles of the page [m]; negative inside."""
    placed = session.placed_obstacles
    assert placed is not None
    path = motion.states.position.double().numpy()
    finer = np.stack([np.interp(np.linspace(0, 1, 400), np.linspace(0, 1, len(path)), axis) for axis in path.T], 1)
    return float(placed.signed_distance(finer).min())


def plan_of(session: Session) -> Motion:
    """The plan of a session."""
    assert session.plan is not None and session.plan.latest is not None
    return session.plan.latest.motion


def until_around(tab: Tab) -> None:
    """Wait until a good plan leads around what the page shows."""
    session = lambda: tab.app.session  # noqa: E731
    tab.until(lambda: session().placed_obstacles is not None, "nothing is placed")
    tab.until(lambda: not list(PlacedObstaclesQuery.pending(session())) or _is_placed(session()), "it is not placed")
    tab.until_planned()
    assert gap(session(), plan_of(session())) > HALF_HEIGHT, "the plan leads through an obstacle"


def _is_placed(session: Session) -> bool:
    return all(query.is_answered(session) for query in PlacedObstaclesQuery.pending(session))


def test_a_plan_gives_way_to_a_box_that_is_dropped_and_dragged_and_undo_takes_it_away(
    serve: Serve, open_tab: OpenTab
) -> None:
    app, tab = with_field(serve, open_tab)
    first = plan_of(app.session)
    box = add_box(tab, TOP_OF_BALL)
    assert box.name == "box 1" and box.entry.box is not None
    until_around(tab)
    drag_box_to(tab, first.states.position[len(first.actions) // 2].numpy())
    until_around(tab)
    assert gap(app.session, first) < -HALF_HEIGHT, "the box does not stand in the way"
    assert app.session.plan is not None and "safety" in app.session.plan.summary, "nobody has judged the plan"
    camera = app.session.view_settings.camera
    tab.key("3")
    tab.until(lambda: app.session.gizmo_mode is GizmoMode.SCALE, "the handles still move it")
    assert app.session.view_settings.camera is camera, "the key turns the camera too"
    tab.press("obstacles.copy")
    tab.until(lambda: len(app.session.obstacles) == 2, "no copy was made")
    names = [placed.name for placed in app.session.obstacles]
    assert names == ["box 1", "box 2"] and app.session.chosen == "box 2"
    tab.press("obstacles.delete")
    tab.until(lambda: len(app.session.obstacles) == 1, "the copy was not deleted")
    text = tab.download("obstacles.save").read_text()
    assert text.startswith('{"obstacles": [\n{"name": "box 1"')
    for _ in range(len(app.session.history.past)):
        tab.key("Control+z")
    tab.until(lambda: not app.session.history.past and app.session.obstacles == (), "not all was undone")
    tab.until(lambda: app.session.placed_obstacles is None, "the box is still in the map")
    tab.until_planned()
    assert plan_of(app.session) is first, "it is another plan"
    tab.key("2")
    tab.until(lambda: app.session.view_settings.camera is not camera, "the key does not turn the camera again")


def test_a_box_that_is_dropped_during_a_flight_is_flown_around(serve: Serve, open_tab: OpenTab) -> None:
    app, tab = with_field(serve, open_tab)
    calm_flights(app)
    first = plan_of(app.session)
    tab.press("status.next.start_flight")
    tab.until(lambda: app.session.flight is not None and len(app.session.flight.steps) > 1, "it does not fly")
    tab.key(" ")
    tab.until(lambda: app.session.job is not None and app.session.job.paused, "it does not hold")
    add_box(tab, TOP_OF_BALL)
    drag_box_to(tab, first.states.position[2 * len(first.actions) // 3].numpy())
    tab.until(lambda: _is_placed(app.session), "it is not placed in flight")
    assert gap(app.session, first) < -HALF_HEIGHT, "the box does not stand in the way"
    flight = app.session.flight
    assert flight is not None
    at = len(flight.steps)
    tab.key(" ")
    tab.until_idle()
    flight, placed = app.session.flight, app.session.placed_obstacles
    assert flight is not None and flight.outcome is not None and flight.outcome.name == "REACHED"
    assert placed is not None and not app.session.flight_is_stale
    truth = np.stack([step.truth.position.double().numpy() for step in flight.steps[at:]])
    assert placed.signed_distance(truth).min() > HALF_HEIGHT


def test_a_plan_and_a_flight_let_a_box_pass_whose_path_was_drawn_across_the_way(
    serve: Serve, open_tab: OpenTab
) -> None:
    app, tab = with_field(serve, open_tab)
    first = plan_of(app.session)
    calm_flights(app)
    box = add_box(tab, TOP_OF_BALL)
    assert box.entry.box is not None
    wide, deep, high = box.entry.box
    app.post(ChangeObstacle(box.name, box.changed(box=(1.6 * wide, 1.6 * deep, high))))  # else it comes too late
    tab.until_shown()
    tab.press("obstacles.draw")
    tab.until(lambda: app.session.drawing is not None, "the page does not wait for way points")
    here, way = np.array(box.entry.position), first.states.position[len(first.actions) // 2].numpy()
    x, y, _ = (2 * way - here).tolist()
    tab.click_at((x, y, box.entry.position[2]))
    tab.until(lambda: app.session.obstacles[0].path is not None, "no way point was added")
    tab.key("Escape")
    tab.until(lambda: app.session.drawing is None, "the path does not end")
    mover = app.session.obstacles[0].obstacle
    assert mover.place(np.array([1e3]))[0, 2] == here[2], "it does not keep its height"

    def gap_of(positions: np.ndarray, dt: float) -> float:
        times = dt * np.arange(len(positions))
        return min(mover.signed_distance(p[None], t)[0] for p, t in zip(positions, times, strict=True))

    tab.until(lambda: app.session.placed_obstacles is not None, "it is not placed")
    tab.until_planned()
    plan = plan_of(app.session)
    assert gap_of(first.states.position.double().numpy(), first.dt) < 0, "it does not cross the way"
    assert gap_of(plan.states.position.double().numpy(), plan.dt) > HALF_HEIGHT, "the plan leads through it"
    tab.press("obstacles.play")
    tab.until(lambda: (app.session.motion_time or 0.0) > 0.3, "its motion is not played")
    tab.press("obstacles.play")
    tab.until(lambda: app.session.motion_time is None, "it is not put back")

    tab.press("status.next.start_flight")
    tab.until(lambda: app.session.in_flight, "it does not fly")
    tab.until_idle()
    flight = app.session.flight
    assert flight is not None and flight.outcome is not None and flight.outcome.name == "REACHED"
    assert not any(step.touched for step in flight.steps)
    truth = np.stack([step.truth.position.double().numpy() for step in flight.steps])
    assert gap_of(truth, flight.tick) > HALF_HEIGHT
    seen = lambda: np.array(tab.page.evaluate(POSITION, "/obstacles/1"))  # noqa: E731
    for at in (2, len(flight.steps) - 1):
        tab.fill("timeline.slider", str(at * flight.tick))
        there = mover.place(np.array([at * flight.tick]))[0]
        tab.until(lambda there=there: np.allclose(seen(), there, atol=1e-3), "it is shown elsewhere")
        assert tab.is_visible("/obstacles/1") and np.linalg.norm(there - here) > 0.05
    for _ in range(len(app.session.history.past)):
        tab.key("Control+z")
    tab.until(lambda: not app.session.history.past and app.session.obstacles == (), "not all was undone")
    tab.until(lambda: app.session.placed_obstacles is None, "the box is still in the place")
    tab.until_planned()
    assert plan_of(app.session) is first, "it is another plan"


STONE = np.array([0.74, -0.665, 0.19])
"""Middle of a stone of Stonehenge [m]: 16 x 15 cm wide, from the ground to 34 cm."""


def test_a_stone_that_is_cut_out_leaves_unproven_space_until_that_is_allowed(serve: Serve, open_tab: OpenTab) -> None:
    app = serve(NavigationBackend(runs=None), what="stonehenge")
    tab = open_tab(app)
    tab.until(lambda: app.session.surface is not None, "no surface is shown", 120)
    x, y, z = STONE.tolist()
    for kind in ("clicked part", "box volume"):
        tab.press("obstacles.cut", kind)
        tab.until(lambda: isinstance(app.session.aiming, ObstacleKind), "the page does not wait for a click")
        tab.click_at((x, y, z))
        tab.until(lambda: bool(app.session.obstacles), "no volume was placed")
        volume = app.session.obstacles[0]
        assert volume.selects and app.session.placed_obstacles is None
        if kind == "clicked part":
            np.testing.assert_allclose(volume.entry.box, (0.42, 1.47, 0.43), atol=0.06)  # its lintels join it to others
            tab.key("Control+z")
            tab.until(lambda: app.session.obstacles == (), "the volume is not taken back")
            tab.until_shown()
    app.post(ChangeObstacle(volume.name, volume.changed(box=(0.24, 0.24, 0.33), position=(x, y, z))))
    tab.until_shown()
    tab.press("obstacles.separate")
    tab.until(lambda: app.session.placed_obstacles is not None, "it was not cut out", 60)
    assert [placed.name for placed in app.session.obstacles] == ["part 1"]
    drag_box(tab, 1, -0.4)
    tab.until(lambda: _is_placed(app.session), "it was not moved")
    assert app.session.obstacles[0].entry.position[1] < y - 0.25, "the hand did not move it"

    app.post(MoveEnd(EndRole.GOAL, End((x, y, 0.16))))
    tab.until(lambda: app.session.problems.get(EndRole.GOAL), "the goal counts as free in unproven space")
    assert "unproven" in str(app.session.problems[EndRole.GOAL]), app.session.problems
    tab.press("status.next.start_plan")
    tab.until(lambda: app.session.trouble is not None, "a plan leads through what nobody saw", 120)
    assert app.session.trouble is not None and "is in unproven space" in app.session.trouble.body
    assert app.session.fresh_plan is None
    app.post(Adjust(Settings.PLAN, "unknown", UnknownSpace.FREE))
    tab.until(lambda: app.session.problems.get(EndRole.GOAL, "?") is None, "there is no room in the gap", 60)
    app.post(StartPlan())
    tab.until_planned(120)
    for _ in range(len(app.session.history.past)):
        tab.key("Control+z")
    tab.until(lambda: not app.session.history.past and app.session.obstacles == (), "not all was undone")
    tab.until(lambda: app.session.placed_obstacles is None, "the stone is not back in the map")
