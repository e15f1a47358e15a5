"""Backend of the worker: begin jobs, answer queries of the page, change stored runs.

Jobs are those that the command line runs too, requested by what the session wants. Experiments run in a process of
their own; each georeferenced field has a folder of its own, until the app ends.
"""


import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from nerfnav.core.errors import NerfnavError
from nerfnav.navigation import NavigateConfig
from nerfnav.planner import PlannerConfig, planners
from nerfnav_app.jobs.events import JobEvents
from nerfnav_app.jobs.export import export
from nerfnav_app.jobs.export import occupancy_map as map_job
from nerfnav_app.jobs.fly import fly
from nerfnav_app.jobs.fly.request import FlyRequest
from nerfnav_app.jobs.open import opening
from nerfnav_app.jobs.plan import compare_planners, plan
from nerfnav_app.jobs.subprocess_job import run_in_subprocess
from nerfnav_app.jobs.track import localize
from nerfnav_app.places.derived import prepare_place
from nerfnav_app.places.place import Place
from nerfnav_app.places.sources import QualityName
from nerfnav_app.queries.following_plan import plan_request
from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.state.actions import RunChanged
from nerfnav_app.state.export_subject import make_recording, name_download
from nerfnav_app.state.job import Job, JobKind, MapDownload, TrajectoryDownload
from nerfnav_app.state.runs import RunChange
from nerfnav_app.state.session import Session
from nerfnav_app.storage.experiment_store import ExperimentStore
from nerfnav_app.storage.run_store import RunStore
from nerfnav_app.text import sentence
from nerfnav_app.worker.operator_requests import SessionRequests


class PlacedFiles:
    """Fields of places that were put right; one can go back to all that were before."""

    def __init__(self) -> None:
        """Nothing is on disk before the first one."""
        self._folder: tempfile.TemporaryDirectory[str] | None = None

    def begin(self, session: Session, job: Job) -> JobEvents:
        """The events of a job that puts the session's place right; it keeps its name."""
        from nerfnav_app.jobs.field import georeference  # slow to import, and seldom needed

        if self._folder is None:
            self._folder = tempfile.TemporaryDirectory(prefix="nerfnav-", ignore_cleanup_errors=True)
        out = Path(self._folder.name) / str(job.id) / f"{Path(session.what).stem}.npz"
        return georeference.run(georeference.PlaceRequest(session.what, session.placing.correction(), out))


def begin_experiment(session: Session, runs: RunStore) -> JobEvents:
    """The experiment that the session asks for; its results are kept beside the runs."""
    asked = session.experiments.asked
    assert asked is not None, "an experiment is begun by who says which"
    out = ExperimentStore(runs.folder).new(asked.name)
    return run_in_subprocess(partial(_do_experiment, asked.name, asked.trials, out))


def _do_experiment(name: str, trials: int | None, out: Path) -> JobEvents:
    # imported where it is done: with their figures, experiments take long to import
    from nerfnav_app.jobs.measure import experiment

    return experiment.run(experiment.ExperimentRequest(name, trials=trials, out=out))


@dataclass
class JobStarter:
    """Begins the jobs of a session, and lets a flight know what the session wants of it."""

    open: Callable[[str, QualityName], JobEvents] = opening.run
    """The job that opens a place, and learns its field in some quality where there is none."""
    plans: Mapping[str, PlannerConfig] = field(default_factory=dict)
    """Name of a planner to how its first plan is made; planners that are not named have settings of their own."""
    navigate: NavigateConfig = field(default_factory=NavigateConfig)
    """How a flight is flown; its noise is what the session has."""
    runs: RunStore | None = field(default_factory=RunStore)
    """Where flights are kept; None keeps none."""
    _flight_orders: SessionRequests | None = None
    _placed: PlacedFiles = field(default_factory=PlacedFiles)

    def begin(self, session: Session, job: Job) -> JobEvents:
        """The events of a job."""
        if job.kind is JobKind.OPEN:
            return self.open(session.what, session.quality)
        place, settings = session.place, session.plan_settings
        assert place is not None, "nothing but opening is asked for before the place is open"
        if job.kind is JobKind.COMPARE:
            requests = [plan_request(settings, job.ends, name, self.plans.get(name)) for name in planners.names()]
            return compare_planners.run(requests, place)
        if job.kind is JobKind.EXPERIMENT:
            return begin_experiment(session, self.runs or RunStore())
        if job.kind is JobKind.FIND:
            picture = session.last_picture
            assert picture is not None, "nothing is looked for without a picture"
            return localize.find(place, picture)
        if job.kind is JobKind.TRACK:
            return _followed(place, job)
        if job.kind is JobKind.PLACE:
            return self._placed.begin(session, job)
        if job.kind is JobKind.MAP:
            assert isinstance(job.wish, MapDownload), "a map is made for who says which"
            name = Path(f"{place.name}-map{job.wish.ending}")
            return map_job.download(place.field, map_job.MapRequest(name))
        if job.kind is JobKind.EXPORT:
            return _export(session, job, place)
        if job.kind is JobKind.PLAN:
            name = session.choice.planner
            return plan.run(plan_request(settings, job.ends, name, self.plans.get(name)), place)
        self._flight_orders = SessionRequests(job, place)
        return fly.run(self._flight(session, job, self._flight_orders), place)

    def follow(self, session: Session) -> None:
        """Let a flight know what the session wants of it now."""
        if self._flight_orders is not None:
            self._flight_orders.follow(session)

    def _flight(self, session: Session, job: Job, orders: SessionRequests) -> FlyRequest:
        """What the session wants to be flown, beginning with a plan that is there already."""
        assert session.place is not None, "flights begin in a place"
        name, flying = session.choice.planner, session.flight_settings
        made = job.first_plan.latest if job.first_plan is not None else None
        return FlyRequest(
            plan_request(session.plan_settings, job.ends, name, self.plans.get(name)),
            plan=None if made is None else made.motion,
            cautious=made is None and not job.anyway,
            estimator=session.choice.estimator,
            open_loop=flying.open_loop,
            seed=flying.seed,
            world=flying.world,
            realtime=flying.realtime,
            config=replace(self.navigate, noise=flying.noise),
            orders=orders.orders,
            source=session.what,
            task=session.task,
            out=None if self.runs is None else self.runs.new(session.place.name),
        )


def _followed(place: Place, job: Job) -> JobEvents:
    """The track of a camera through the place."""
    # slow to import, and seldom needed
    from nerfnav.tracking import SourceOptions
    from nerfnav_app.jobs.track import track
    from nerfnav_app.jobs.track.camera import GivenCamera
    from nerfnav_app.jobs.track.camera_run import CameraRun

    asked = job.track
    assert asked is not None, "a track is begun by who says of what"
    camera, options = GivenCamera(fov_deg=asked.fov_deg), SourceOptions(asked.fps)
    return track.watch(place.field, CameraRun(asked.source, camera, options))


def _export(session: Session, job: Job, place: Place) -> JobEvents:
    """What a vehicle is to fly, judged in the place as planners see it."""
    wish, made = job.wish, make_recording(session)
    assert isinstance(wish, TrajectoryDownload) and made is not None, "there is something to take away, in some format"
    seen = prepare_place(place, session.plan_settings.unknown)
    return export.download(made.with_field(seen.field), wish.format, name_download(session, wish.format), wish.force)


@dataclass
class NavigationBackend(JobStarter):
    """Opens places, plans and flies in them. Used by the worker's thread alone."""

    def answer(self, place: Place, query: Query[Any]) -> Any:
        """The result of a query of the page."""
        return query.answer(Resources(place, self.runs, self.plans))

    def change(self, change: RunChange) -> RunChanged:
        """Rename or delete a stored run; where that fails, what is in the way."""
        if self.runs is None:
            return RunChanged(change, "No runs are kept here.")
        try:
            if change.to is None:
                self.runs.delete(change.name)
            else:
                self.runs.rename(change.name, change.to)
        except NerfnavError as error:
            return RunChanged(change, sentence(self.runs.without_folder(str(error))))
        return RunChanged(change)
