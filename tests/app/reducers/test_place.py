"""Opening places and choosing robots: start and goal suit the robot, and nothing of the place before is left."""

from dataclasses import replace

import nerfnav_scenes as scenes
from nerfnav.field import UnknownSpace, planning_field
from nerfnav.planner import fits
from nerfnav.robots import load
from nerfnav.world.task import Task
from nerfnav_app.jobs.events import JobFinished, PlaceOpened
from nerfnav_app.places.ends import End, EndRole, Ends
from nerfnav_app.places.place import Place, Truth
from nerfnav_app.queries.catalog import pending_queries
from nerfnav_app.queries.end_fit import EndFitQuery
from nerfnav_app.queries.experiments import Experiments, ExperimentsQuery
from nerfnav_app.queries.first_ends import FirstEnds, FirstEndsQuery
from nerfnav_app.queries.query import Resources
from nerfnav_app.state import actions as m
from nerfnav_app.state.place import Choice
from nerfnav_app.state.runs import ListExperiments
from nerfnav_app.state.session import Session
from tests.app.doubles import balls_place
from tests.app.sessions import after, planned, reports

_FLIGHT = Task("fly", (0.8, 0.0, 0.4), (-0.8, 0.0, 0.4))
_MOVE = Task("move", (0.7, -0.7, 0.1), (-0.7, 0.7, 0.1), robot="couch")


def place_with(*tasks: Task) -> Place:
    """Three balls, and tasks for robots among them."""
    return replace(balls_place(), truth=Truth(tasks, lambda: scenes.load("blocks")))


def opened_in(place: Place, robot: str = "quadrotor") -> Session:
    """A session whose place is open, where nothing has been asked of the worker yet."""
    return reports(Session.opening("balls", Choice(robot)), PlaceOpened(place), JobFinished("open"))


def choosing(session: Session, robot: str) -> Session:
    return after(session, m.Choose(replace(session.choice, robot=robot)))


def test_without_a_task_ends_are_sought_and_fit() -> None:
    session = opened_in(balls_place())
    assert session.seeking and not any(isinstance(query, EndFitQuery) for query in pending_queries(session))
    (query,) = FirstEndsQuery.pending(session)
    assert session.place is not None and pending_queries(session)[0] == query, "nothing is more urgent"
    session = after(session, m.QueryAnswered(query, query.answer(Resources(session.place))))
    assert not session.seeking and session.plan_settings.shortest and session.view is not None
    field, robot = planning_field(balls_place().field, UnknownSpace.OCCUPIED), load("quadrotor")
    for which in EndRole:
        assert fits(field, robot.body, session.ends.of(which).state())
    away = after(session, m.MoveEnd(EndRole.GOAL, End((0.1, 0.8, 0.6))))
    assert after(away, m.Reset()).ends == session.ends


def test_ends_that_somebody_has_put_meanwhile_stay() -> None:
    session = opened_in(balls_place())
    (query,) = FirstEndsQuery.pending(session)
    moved = after(session, m.MoveEnd(EndRole.GOAL, End((0.1, 0.8, 0.6))))
    assert after(moved, m.QueryAnswered(query, FirstEnds(Ends()))) == moved


def test_a_robot_without_room_is_told_why_in_one_sentence() -> None:
    session = opened_in(balls_place(), "sofa")
    (query,) = FirstEndsQuery.pending(session)
    assert session.place is not None and session.place.robot.name == "sofa"
    answer = query.answer(Resources(session.place))
    assert answer.ends is None
    session = after(session, m.QueryAnswered(query, answer))
    assert session.trouble is not None and "no level ground" in session.trouble.body and not session.seeking


def test_another_robot_goes_to_its_own_task_and_height() -> None:
    session = opened_in(place_with(_FLIGHT, _MOVE))
    assert session.task == "fly" and not session.seeking
    session = choosing(session, "couch")
    assert (session.task, session.ends) == ("move", Ends.of_task(_MOVE)) and not session.seeking
    assert choosing(session, "diffdrive").seeking


def test_a_task_brings_the_robot_that_it_is_for() -> None:
    session = after(planned(opened_in(place_with(_FLIGHT, _MOVE))), m.ChooseTask("move"))
    assert session.place is not None and session.place.robot.name == session.choice.robot == "couch"
    assert session.ends == Ends.of_task(_MOVE) and session.plan is None


def test_a_place_is_opened_with_the_robot_that_was_chosen() -> None:
    session = opened_in(place_with(_FLIGHT, _MOVE), "couch")
    assert session.place is not None and session.place.robot.name == "couch" and session.task == "move"


def test_a_duration_is_found_where_the_robot_is_too_slow_for_the_task() -> None:
    assert not opened_in(place_with(_FLIGHT)).plan_settings.shortest
    slow = Task("crawl", (0.8, 0.0, 0.1), (-0.8, 0.0, 0.1), robot="cart")
    assert opened_in(place_with(slow), "cart").plan_settings.shortest


def test_nothing_of_the_last_place_is_left_while_another_is_opened(opened: Session) -> None:
    session = after(planned(opened), m.OpenPlace("elsewhere.npz"))
    assert session.place is None and session.plan is None and session.problems == {} and session.surface is None
    assert session.job is not None and session.job.label == "Opening elsewhere.npz"


def test_how_well_places_are_learned_is_chosen_once_for_all_that_are_opened(opened: Session) -> None:
    session = after(opened, m.ChooseQuality("draft"), m.OpenPlace("room.zip"))
    assert opened.quality == "good" and session.quality == "draft"


def test_experiments_are_listed_in_every_place_that_is_opened(opened: Session) -> None:
    session = after(opened, ListExperiments())
    (query,) = ExperimentsQuery.pending(session)
    session = after(session, m.QueryAnswered(query, Experiments((("planners", "which is best"),))))
    assert query not in pending_queries(session)
    session = reports(after(session, m.OpenPlace("elsewhere.npz")), PlaceOpened(balls_place()), JobFinished("open"))
    assert query in pending_queries(session)


def test_a_place_whose_tasks_are_for_another_robot_has_that_unless_one_was_chosen() -> None:
    of_true_size = place_with(replace(_FLIGHT, robot="crazyflie"), _MOVE)
    session = opened_in(of_true_size)
    assert (session.choice.robot, session.task) == ("crazyflie", "fly")
    assert session.place is not None and session.place.robot.name == "crazyflie"
    assert opened_in(of_true_size, "x500").choice.robot == "x500"

    def then_opened(session: Session) -> Session:
        return reports(after(session, m.OpenPlace("other")), PlaceOpened(place_with(_FLIGHT)), JobFinished("open"))

    assert then_opened(session).choice.robot == "quadrotor"
    assert then_opened(choosing(session, "x500")).choice.robot == "x500"
