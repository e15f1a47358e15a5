"""What the robot believes to see: rough while a flight goes on, sharp as soon as it holds or is over."""

import numpy as np
import pytest

from nerfnav_app.jobs.events import JobFinished, JobResult
from nerfnav_app.places.ends import End, Ends
from nerfnav_app.queries.catalog import pending_queries
from nerfnav_app.queries.query import Resources
from nerfnav_app.queries.robot_view import RobotViewQuery
from nerfnav_app.reducers.root import reduce
from nerfnav_app.state import actions as m
from nerfnav_app.state.session import Session
from tests.app.doubles import balls_place, flight_step
from tests.app.sessions import after, reports

PLACE = balls_place()
ENDS = Ends(End((-0.7, 0.0, 0.4)), End((0.7, 0.0, 0.4)))


@pytest.fixture
def flying(opened: Session) -> Session:
    """A session whose flight has taken one step."""
    begun = after(opened, m.StartFlight())
    return reports(begun, flight_step(begun.ends, 0), flight_step(begun.ends, 1))


def asked(session: Session) -> RobotViewQuery:
    (query,) = RobotViewQuery.pending(session)
    return query


def test_a_flight_that_goes_on_asks_for_a_rough_picture_and_one_that_holds_or_is_over_for_a_sharp_one(
    flying: Session,
) -> None:
    rough = asked(flying)
    assert rough.rough
    answered = after(flying, m.QueryAnswered(rough, (np.zeros((2, 2, 3), np.uint8),)))
    assert not any(isinstance(query, RobotViewQuery) for query in pending_queries(answered))
    over = reports(answered, JobFinished("fly", JobResult({})))
    for later in (reduce(answered, m.Pause()), over):
        assert asked(later).key == rough.key and not asked(later).rough


def test_a_rough_picture_is_as_large_and_nearly_the_same() -> None:
    state = ENDS.start.state()
    sharp, rough = (
        RobotViewQuery(("ends", ENDS), (state,), rough).answer(Resources(PLACE))[0].astype(float)
        for rough in (False, True)
    )
    camera = PLACE.robot.camera
    assert sharp.shape == rough.shape == (camera.height, camera.width, 3)
    assert sharp.std() > 5 and 0 < abs(sharp - rough).mean() < 0.1 * sharp.std()
