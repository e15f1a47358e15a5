"""What the worker can do for this app: the jobs that the command line runs too, and answers to the page."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import torch

from app.choice import Choice
from app.ends import Ends
from app.events import JobFinished
from app.helm import Helm
from app.jobs import fly, plan, scene
from app.jobs.fly import CAMERA, FlyRequest
from app.jobs.plan import PlanRequest
from app.messages import Answer, EndQuestion, EndReport, PlanQuestion, Question, Replanned, View, ViewQuestion
from app.place import Place, occupancy_of
from app.session import Job, JobKind, Session
from nerfnav.errors import NerfnavError
from nerfnav.field.render import render_image
from nerfnav.geometry.camera import FORWARD_MOUNT
from nerfnav.navigation.replan import NavigateConfig
from nerfnav.planner.ends import nearest_free
from nerfnav.planner.fast import FastPlanConfig
from nerfnav.planner.occupancy import OccupancyConfig, OccupancyMap, body_density
from nerfnav.planner.optimize import PlanConfig
from nerfnav.planner.steps import PlanStep
from nerfnav.robots.state import RigidState


@dataclass
class NavigationWork:
    """Opens places, plans and flies in them. Used by the worker's thread alone."""

    open: Callable[[str], Iterator[Any]] = scene.run
    """The job that opens a place."""
    plans: Mapping[str, PlanConfig | FastPlanConfig] = field(default_factory=dict)
    """Name of a planner to how its first plan is made; planners that are not named have settings of their own."""
    navigate: NavigateConfig = field(default_factory=NavigateConfig)
    """How a flight is flown; its `plan` gives way to the above, its noise to what the session has."""
    _helm: Helm | None = None

    def begin(self, session: Session, job: Job) -> Iterator[Any]:
        """The events of a job."""
        if job.kind is JobKind.OPEN:
            return self.open(session.what)
        assert session.place is not None, "nothing but opening is asked for before the place is open"
        route = self._route(job.ends, session.choice)
        if job.kind is JobKind.PLAN:
            return plan.run(route, session.place)
        made = job.first_plan.latest if job.first_plan is not None else None
        self._helm = Helm(job)
        flying = session.flying
        request = FlyRequest(
            route,
            plan=None if made is None else made.motion,
            estimator=session.choice.estimator,
            open_loop=flying.open_loop,
            seed=flying.seed,
            config=replace(self.navigate, noise=flying.noise),
            orders=self._helm.orders,
        )
        return fly.run(request, session.place)

    def follow(self, session: Session) -> None:
        """Let a flight know what the session wants of it now."""
        if self._helm is not None:
            self._helm.follow(session)

    def answer(self, session: Session, question: Question) -> Answer:
        """Whether the robot fits at an end, or what the field looks like from a state."""
        place = session.place
        assert place is not None, "there are no questions before the place is open"
        if isinstance(question, ViewQuestion):
            return View(question, tuple(view_from(place, state) for state in question.states))
        if isinstance(question, PlanQuestion):
            return self._replanned(question, place)
        return EndReport(question, problem_at(place, question, occupancy_of(place, OccupancyConfig())))

    def _replanned(self, question: PlanQuestion, place: Place) -> Replanned:
        steps, summary = [], {}
        with suppress(NerfnavError):  # the ends are shown with what is wrong with them
            for event in plan.run(self._route(question.ends, question.choice), place):
                if isinstance(event, PlanStep):
                    steps.append(event)
                elif isinstance(event, JobFinished):
                    summary = event.summary
        return Replanned(question, tuple(steps), summary)

    def _route(self, ends: Ends, choice: Choice) -> PlanRequest:
        start, goal = ends.start, ends.goal
        config = self.plans.get(choice.planner)
        return PlanRequest(
            start.position, goal.position, start.yaw, goal.yaw, planner=choice.planner, config=config
        )


def problem_at(place: Place, question: EndQuestion, occupancy: OccupancyMap) -> str | None:
    """Why the robot cannot be at this end, or None."""
    body, state = place.robot.body, question.end.state()
    if body_density(place.field, body, state) <= occupancy.config.threshold:
        return None
    nearest = nearest_free(place.field, body, state, occupancy)
    if nearest is None:
        return f"the {question.which.value} is in occupied space, far from any free point."
    x, y, z = nearest.tolist()
    return f"the {question.which.value} is in occupied space; the nearest free point is ({x:.2f}, {y:.2f}, {z:.2f})."


def view_from(place: Place, state: RigidState) -> np.ndarray:
    """The field as the robot's camera would see it, sRGB bytes."""
    rendering = render_image(place.field, CAMERA, state.pose.compose(FORWARD_MOUNT))
    return (255 * rendering.color.clamp(0, 1)).round().to(torch.uint8).numpy()
