"""The worker's thread, with jobs made by hand."""

import itertools
import queue
import threading
import time
from collections.abc import Callable, Generator, Iterator
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numba.core.event
import pytest

from nerfnav.core.errors import NerfnavError
from nerfnav.core.jit import Kernel
from nerfnav.planner.steps import PlanOutcome, PlanStep
from nerfnav_app.jobs.events import COMPILING, JobFailed, JobFinished, JobResult, PlaceOpened, Progress, SurfaceShaped
from nerfnav_app.places.ends import End, EndRole
from nerfnav_app.queries import catalog
from nerfnav_app.queries.catalog import pending_queries
from nerfnav_app.queries.clearance import ClearanceQuery
from nerfnav_app.queries.following_plan import FollowingPlanQuery, SessionPlan
from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.queries.robot_view import RobotViewQuery
from nerfnav_app.reducers.root import reduce
from nerfnav_app.state import actions as m
from nerfnav_app.state.job import Job, JobKind
from nerfnav_app.state.session import Session
from nerfnav_app.worker.open_queries import OpenQueries
from nerfnav_app.worker.worker import Worker
from tests.app.doubles import ScriptedWork, balls_place, flight_step, plan_step
from tests.waiting import PATIENCE_S, until


class Loop:
    """A UI loop without a page: reduces what the worker posts, and tells the worker."""

    def __init__(self, work: ScriptedWork) -> None:
        self.inbox: queue.SimpleQueue[Any] = queue.SimpleQueue()
        self.session = Session.opening("balls")
        self.seen: list[Any] = []
        self.worker = Worker(work, self.inbox.put, threads=1)
        self.worker.start()
        self.worker.follow(self.session)

    def take(self, *messages: Any) -> None:
        for message in messages:
            self.seen.append(message)
            before, self.session = self.session, reduce(self.session, message)
            if isinstance(message, m.QueryAnswered) and self.session is before:
                self.worker.ask_again(message.query)  # type: ignore[arg-type]
            self.worker.follow(self.session)

    def until(self, condition: Callable[[], bool], timeout_s: float = PATIENCE_S) -> None:
        """Take in messages until `condition` holds."""
        end = time.monotonic() + timeout_s
        while not condition():
            assert time.monotonic() < end, "the worker did not get there in time"
            try:
                self.take(self.inbox.get(timeout=0.05))
            except queue.Empty:
                continue

    def settle(self, quiet_s: float = 0.3) -> None:
        """Take in messages until none comes any more."""
        while True:
            try:
                self.take(self.inbox.get(timeout=quiet_s))
            except queue.Empty:
                return

    def events(self) -> list[Any]:
        return [message.event for message in self.seen if isinstance(message, m.Reported)]


@dataclass(frozen=True)
class CountedQuery(Query[int]):
    """Query for how often it was asked; the first answer is dropped."""

    name: str

    @classmethod
    def pending(cls, session: Session) -> Iterator["CountedQuery"]:
        """Ask always."""
        yield from (cls("late"), cls("failing"))

    def answer(self, resources: Resources) -> int:
        """Leave it to the work."""
        raise NotImplementedError

    def apply(self, session: Session, result: int) -> Session:
        """Keep the second answer."""
        return super().apply(session, result) if result > 1 else session


def asked_plans(work: ScriptedWork) -> int:
    """How many plans the worker has begun."""
    return sum(isinstance(query, FollowingPlanQuery) for query in work.asked)


@pytest.fixture
def loop_for() -> Iterator[Callable[[ScriptedWork], Loop]]:
    """Makes loops whose place is open, and ends their workers."""
    made: list[Loop] = []

    def make(work: ScriptedWork) -> Loop:
        loop = Loop(work)
        made.append(loop)
        loop.until(lambda: loop.session.job is None or (loop.session.place is None and bool(loop.session.notices)))
        return loop

    yield make
    for loop in made:
        loop.worker.stop()


def test_the_worker_opens_the_place_and_answers_the_page(loop_for: Callable[[ScriptedWork], Loop]) -> None:
    work = ScriptedWork()
    loop = loop_for(work)
    loop.until(lambda: loop.session.place is not None and pending_queries(loop.session) == ())
    loop.settle()
    assert len(work.asked) == len(set(work.asked)) == 3


def test_a_job_reports_all_its_events_in_order(loop_for: Callable[[ScriptedWork], Loop]) -> None:
    steps = [lambda job, k=k: plan_step(job.ends, k) for k in range(50)]
    loop = loop_for(ScriptedWork({JobKind.PLAN: [*steps, JobResult()]}))
    loop.take(m.StartPlan())
    loop.until(lambda: loop.session.job is None)
    iterations = [event.iteration for event in loop.events() if hasattr(event, "iteration")]
    assert iterations == list(range(50))


def test_a_step_that_compiles_says_so_and_then_says_again_what_the_job_is_about(
    loop_for: Callable[[ScriptedWork], Loop],
) -> None:
    def compile_one(job: Job) -> PlanStep:
        Kernel(lambda x: x + 1, {})(1.0)
        return plan_step(job.ends, 0)

    way = Progress("finding a way", 0.3)
    loop = loop_for(ScriptedWork({JobKind.PLAN: [way, compile_one, JobResult()]}))
    loop.take(m.StartPlan())
    loop.until(lambda: loop.session.job is None)
    told = [event for event in loop.events() if isinstance(event, Progress)]
    assert told[-3:] == [way, Progress(COMPILING, 0.3), way]


def test_a_job_that_waits_for_the_step_of_another_one_that_compiles_says_so(
    loop_for: Callable[[ScriptedWork], Loop],
) -> None:
    compiling, done = threading.Event(), threading.Event()
    Kernel(lambda x: x + 1, {})(1.0)  # from now on compilation is heard of

    def compile_long(job: Job) -> PlanStep:
        with numba.core.event.trigger_event("numba:compile"):
            compiling.set()
            assert done.wait(PATIENCE_S)
        return plan_step(job.ends, 0)

    loop = loop_for(ScriptedWork({JobKind.PLAN: [compile_long, JobResult()]}))
    loop.take(m.StartPlan())
    loop.until(compiling.is_set)
    loop.take(m.Cancel(), m.StartFlight())
    loop.until(lambda: loop.session.job is not None and loop.session.job.label == COMPILING)
    assert loop.session.job is not None and loop.session.job.kind is JobKind.FLY
    done.set()
    loop.until(lambda: loop.session.job is None)


@pytest.mark.parametrize(
    ("error", "words"),
    [(NerfnavError("the goal is in a stone"), "the goal is in a stone"), (ValueError("oh"), "fault of the program")],
)
def test_errors_of_a_job_are_told_and_the_next_job_runs(
    loop_for: Callable[[ScriptedWork], Loop], error: Exception, words: str
) -> None:
    work = ScriptedWork({JobKind.PLAN: [error]})
    loop = loop_for(work)
    loop.take(m.StartPlan())
    loop.until(lambda: loop.session.job is None)
    assert words in loop.session.notices[-1].body
    work.scripts[JobKind.PLAN] = [lambda job: plan_step(job.ends, 0), JobResult()]
    loop.take(m.StartPlan())
    loop.until(lambda: loop.session.job is None)
    assert loop.session.plan is not None and loop.session.plan.latest is not None


def test_a_cancelled_job_is_closed_after_the_step_in_progress(loop_for: Callable[[ScriptedWork], Loop]) -> None:
    held = threading.Event()

    def slow(job: Any) -> Progress:
        held.wait(PATIENCE_S)
        return Progress("optimising", 0.5)

    work = ScriptedWork({JobKind.PLAN: [Progress("optimising", 0.0), slow, *[Progress("optimising", 1.0)] * 1000]})
    loop = loop_for(work)
    loop.take(m.StartPlan())
    loop.until(lambda: loop.session.job is not None and loop.session.job.fraction == 0.0)
    number = loop.session.job.id  # type: ignore[union-attr]
    loop.take(m.Cancel())
    held.set()
    loop.until(lambda: number in work.closed)
    loop.settle()
    assert sum(isinstance(event, Progress) and event.fraction == 1.0 for event in loop.events()) == 0


def test_a_paused_flight_waits_and_takes_single_steps(loop_for: Callable[[ScriptedWork], Loop]) -> None:
    begun, gate = threading.Event(), threading.Event()

    def first(job: Any) -> Any:
        begun.set()
        gate.wait(PATIENCE_S)
        return flight_step(job.ends, 0)

    steps = [lambda job, k=k: flight_step(job.ends, k) for k in range(1, 30)]
    loop = loop_for(ScriptedWork({JobKind.FLY: [first, *steps, JobResult()]}))
    loop.take(m.StartFlight())
    assert begun.wait(PATIENCE_S)
    loop.take(m.Pause())
    gate.set()
    loop.until(lambda: loop.session.steps_reported == 1)
    loop.settle()
    assert loop.session.steps_reported == 1
    loop.take(m.StepOnce())
    loop.until(lambda: loop.session.steps_reported == 2)
    loop.settle()
    assert loop.session.steps_reported == 2
    loop.take(m.Resume())
    loop.until(lambda: loop.session.job is None)
    assert loop.session.steps_reported == 30


def test_questions_are_answered_while_a_job_runs(loop_for: Callable[[ScriptedWork], Loop]) -> None:
    def slow(job: Any) -> Progress:
        time.sleep(0.01)
        return Progress("optimising", 0.5)

    work = ScriptedWork({JobKind.PLAN: [slow] * 10_000 + [JobResult()]})
    loop = loop_for(work)
    loop.settle()
    loop.take(m.StartPlan(), m.MoveEnd(EndRole.GOAL, End((0.5, -0.5, 0.5))))
    loop.until(lambda: pending_queries(loop.session) == ())
    assert loop.session.job is not None


def test_a_plan_that_was_asked_for_before_the_last_one_was_shown_is_shown_too(
    loop_for: Callable[[ScriptedWork], Loop],
) -> None:
    may_answer = threading.Event()

    class Planning(ScriptedWork):
        """Work whose plans wait until they may be answered."""

        def answer(self, place: Any, query: Any) -> Any:
            if not isinstance(query, FollowingPlanQuery):
                return super().answer(place, query)
            self.asked.append(query)
            assert may_answer.wait(PATIENCE_S)
            return SessionPlan((plan_step(query.record.ends, 0, PlanOutcome.CONVERGED),))

    work = Planning({JobKind.PLAN: [lambda job: plan_step(job.ends, 0, PlanOutcome.CONVERGED), JobResult()]})
    loop = loop_for(work)
    loop.take(m.StartPlan())
    loop.until(lambda: loop.session.fresh_plan is not None and pending_queries(loop.session) == ())
    goals = [m.MoveEnd(EndRole.GOAL, End((x, -0.5, 0.4))) for x in (0.5, 0.4)]
    loop.take(goals[0])
    until(lambda: asked_plans(work) == 1, "the plan is not begun")
    loop.take(goals[1])
    may_answer.set()
    until(lambda: asked_plans(work) == 2, "the next plan is not begun")  # before the first answer is taken in
    loop.until(lambda: loop.session.fresh_plan is not None)
    assert loop.session.plan is not None and loop.session.plan.ends.goal == goals[1].end


@dataclass
class Measuring(ScriptedWork):
    """Work that measures clearances in many steps; `left` allows for so many."""

    left: int = 1_000_000
    begun: int = 0
    dropped: list[Query[Any]] = field(default_factory=list)

    def steps(self, place: Any, query: Any) -> Generator[None, None, Any]:
        answer = super().steps(place, query)
        if not isinstance(query, ClearanceQuery):
            return (yield from answer)
        self.begun += 1
        try:
            while self.left > 0:
                self.left -= 1
                yield
            return (yield from answer)
        except GeneratorExit:
            self.dropped.append(query)
            raise

    @classmethod
    def with_plan(cls) -> "Measuring":
        """Work whose plans are good at once."""
        return cls({JobKind.PLAN: [lambda job: plan_step(job.ends, 0, PlanOutcome.CONVERGED), JobResult()]})


def test_a_hand_does_not_wait_for_the_rest_of_a_long_answer(loop_for: Callable[[ScriptedWork], Loop]) -> None:
    work = Measuring.with_plan()
    loop = loop_for(work)
    loop.take(m.StartPlan())
    loop.until(lambda: loop.session.fresh_plan is not None and work.begun == 1)
    loop.take(m.MoveEnd(EndRole.GOAL, End((0.5, -0.5, 0.4)), held=True))
    loop.until(lambda: asked_plans(work) == 1)
    assert work.left > 0 and len(work.dropped) == 1, "the plan waits until the clearance of the last one is measured"


def test_a_long_answer_goes_on_after_what_is_more_urgent(loop_for: Callable[[ScriptedWork], Loop]) -> None:
    work = Measuring.with_plan()
    loop = loop_for(work)
    loop.take(m.StartPlan())
    loop.until(lambda: work.begun == 1)
    loop.take(m.MoveEnd(EndRole.GOAL, End((0.5, -0.5, 0.4))))
    loop.until(lambda: asked_plans(work) == 1)
    work.left = 0
    loop.until(lambda: ClearanceQuery.result_in(loop.session) is not None)
    assert work.begun == 1 and not work.dropped


def test_a_long_answer_begins_again_in_another_place(loop_for: Callable[[ScriptedWork], Loop]) -> None:
    loop = loop_for(Measuring.with_plan())
    loop.take(m.StartPlan())
    loop.until(lambda: loop.session.fresh_plan is not None and loop.session.job is None)
    loop.worker.stop()
    work = Measuring()
    queries, session = OpenQueries(work), loop.session
    (query,) = (query for query in pending_queries(session) if isinstance(query, ClearanceQuery))
    assert queries.answer(session, query) is None and queries.answer(session, query) is None
    assert work.begun == 1
    assert session.place is not None
    elsewhere = replace(session, place=replace(session.place, name="another"))
    assert queries.take(elsewhere, busy=False) is not None and work.dropped == [query]
    work.left = 0
    assert queries.answer(elsewhere, query) is not None and work.begun == 2


def test_a_query_whose_answer_came_too_late_is_asked_again_and_one_that_failed_is_not(
    loop_for: Callable[[ScriptedWork], Loop],
) -> None:
    class Late(ScriptedWork):
        """Work of which the first answer is not wanted any more, and one has failed."""

        def answer(self, place: Any, query: Any) -> Any:
            if not isinstance(query, CountedQuery):
                return super().answer(place, query)
            self.asked.append(query)
            if query.name == "failing":
                raise NerfnavError("it fails")
            return len([one for one in self.asked if one == query])

    work = Late()
    catalog.register(CountedQuery)
    try:
        loop = loop_for(work)
        loop.until(lambda: CountedQuery.result_in(loop.session) is not None)
        loop.settle()
    finally:
        catalog.unregister(CountedQuery)
    assert CountedQuery.result_in(loop.session) == 2
    assert sorted(query.name for query in work.asked if isinstance(query, CountedQuery)) == ["failing", "late", "late"]


def test_pictures_of_a_flight_leave_it_most_of_the_time(loop_for: Callable[[ScriptedWork], Loop]) -> None:
    class Slow(ScriptedWork):
        """Work that takes 40 ms for each picture of a flight."""

        def answer(self, place: Any, query: Any) -> Any:
            looked = isinstance(query, RobotViewQuery) and query.rough
            time.sleep(0.04 if looked else 0.0)
            self.pictures.extend([time.monotonic()] * looked)
            return super().answer(place, query)

        pictures: ClassVar[list[float]] = []

    def step(job: Any, k: int) -> Any:
        time.sleep(0.005)
        return flight_step(job.ends, k)

    work = Slow({JobKind.FLY: [*(lambda job, k=k: step(job, k) for k in range(300)), JobResult()]})
    loop = loop_for(work)
    loop.settle()
    loop.take(m.Adjust(m.Settings.FLIGHT, "pace", 0.0), m.StartFlight())
    loop.until(lambda: loop.session.job is None)
    assert len(work.pictures) > 1  # it is looked at all the same
    assert min(later - before for before, later in itertools.pairwise(work.pictures)) >= 0.5
    loop.until(lambda: pending_queries(loop.session) == ())
    assert work.asked[-1].pause == 0  # where the flight ended, in full


def test_an_answer_that_took_long_once_does_not_put_the_next_one_off_for_long(
    loop_for: Callable[[ScriptedWork], Loop],
) -> None:
    session = loop_for(ScriptedWork()).session

    class Compiling(ScriptedWork):
        """Work whose first picture waits for the compiler."""

        def answer(self, place: Any, query: Any) -> Any:
            time.sleep(0.3)
            return ()

    queries = OpenQueries(Compiling())
    first, second = (RobotViewQuery(("flight", 0, 0, k), (), rough=True) for k in range(2))
    queries.answer(session, first)
    assert queries.is_resting(second)
    time.sleep(0.6)
    assert not queries.is_resting(second)


def test_a_job_that_just_ends_leaves_nothing_running(loop_for: Callable[[ScriptedWork], Loop]) -> None:
    loop = loop_for(ScriptedWork({JobKind.PLAN: []}))
    loop.take(m.StartPlan())
    loop.until(lambda: loop.session.job is None)
    assert loop.events()[-1] == JobFinished("plan")


def test_a_place_that_cannot_be_opened_is_told(loop_for: Callable[[ScriptedWork], Loop]) -> None:
    loop = loop_for(ScriptedWork({JobKind.OPEN: [NerfnavError("this is no field file")]}))
    loop.settle()
    assert loop.session.place is None and loop.session.notices[-1].body == "this is no field file"
    assert any(isinstance(event, JobFailed) for event in loop.events())


def test_a_flight_is_no_faster_than_its_pace(loop_for: Callable[[ScriptedWork], Loop]) -> None:
    steps = [lambda job, k=k: flight_step(job.ends, k) for k in range(6)]
    loop = loop_for(ScriptedWork({JobKind.FLY: [*steps, JobResult()]}))
    began = time.monotonic()
    loop.take(m.Adjust(m.Settings.FLIGHT, "pace", 2.0), m.StartFlight())
    loop.until(lambda: loop.session.job is None)
    assert time.monotonic() - began >= 5 * 0.1 / 2.0 - 0.01
    assert loop.session.steps_reported == 6


def test_warming_up_is_left_when_somebody_plans() -> None:
    def compiling(_: object) -> Progress:
        time.sleep(0.01)
        return Progress("compiling", 0.6)

    warming = [compiling] * 10_000
    opening = [PlaceOpened(balls_place()), SurfaceShaped(b"glTF"), *warming, JobResult()]
    plan = [lambda job: plan_step(job.ends, 0, PlanOutcome.CONVERGED), JobResult()]
    loop = Loop(ScriptedWork({JobKind.OPEN: opening, JobKind.PLAN: plan}))
    try:
        loop.until(lambda: loop.session.may_begin)
        loop.take(m.StartPlan())
        loop.until(lambda: loop.session.fresh_plan is not None and loop.session.job is None)
        assert JobFinished("open") not in loop.events() and loop.session.surface == b"glTF"
    finally:
        loop.worker.stop()
