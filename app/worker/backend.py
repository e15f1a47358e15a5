"""Backend of the worker: begin jobs, answer queries of the page, change stored runs.

Jobs are those of the command line, with the settings of the session. Experiments run in a process of their own; each
georeferenced field has a folder of its own.
"""

import tempfile
from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

from nerfnav.core.errors import InvalidInputError, NerfnavError
from nerfnav.export import FORMATS
from nerfnav.importers import Corners
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
from nerfnav_app.places.ground import put_on_ground
from nerfnav_app.places.library import PlaceLibrary
from nerfnav_app.places.place import Place
from nerfnav_app.places.sources import QualityName
from nerfnav_app.queries.following_plan import plan_request
from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.state.actions import RunChanged
from nerfnav_app.state.export_subject import make_recording, name_download
from nerfnav_app.state.job import Job, JobKind, MapDownload, TrajectoryDownload
from nerfnav_app.state.runs import RunChange, StartExperiment
from nerfnav_app.state.session import Session
from nerfnav_app.state.tracks import StartTrack
from nerfnav_app.storage.experiment_store import ExperimentStore
from nerfnav_app.storage.run_store import RunStore
from nerfnav_app.text import sentence
from nerfnav_app.worker.operator_requests import SessionRequests


@dataclass
class NavigationBackend:
    """Opens places, plans and flies in them. Used by the worker's thread alone."""

    open: Callable[[str, QualityName, Corners | None], JobEvents] = opening.run
    """Job that opens a place, and makes its field in some quality, in a box if one is given, where there is none."""
    plans: Mapping[str, PlannerConfig] = field(default_factory=dict)
    """Settings of first plans by the planner's name; other planners use their own."""
    navigate: NavigateConfig = field(default_factory=NavigateConfig)
    """Configuration of flights, but for the noise, which is that of the session."""
    runs: RunStore | None = field(default_factory=RunStore)
    """Store of flights; None keeps none."""
    _requests: SessionRequests | None = None
    _georeferenced: tempfile.TemporaryDirectory[str] | None = None

    def begin(self, session: Session, job: Job) -> JobEvents:
        """Begin a job. Raises InvalidInputError where the session lacks what the job needs."""
        place = session.place
        if job.kind is JobKind.OPEN or place is None:
            return self.open(session.what, session.quality, session.box)
        match job.kind:
            case JobKind.PLAN:
                return plan.run(self._plan_request(session, job, place, session.choice.planner), place)
            case JobKind.COMPARE:
                routes = [self._plan_request(session, job, place, name) for name in planners.names()]
                return compare_planners.run(routes, place)
            case JobKind.FLY:
                ends = put_on_ground(place, job.ends, session.plan_settings.unknown)
                self._requests = SessionRequests(replace(job, ends=ends), place)
                return self._requests.watch(fly.run(self._fly_request(session, job, place, self._requests), place))
            case JobKind.PLACE:
                return self._georeference(session, job, place)
            case JobKind.MAP if isinstance(job.request, MapDownload):
                return map_job.download(place.field, map_job.MapRequest(Path(f"{place.name}-map{job.request.ending}")))
            case JobKind.EXPORT if isinstance(job.request, TrajectoryDownload):
                return _export(session, job.request, place)
            case JobKind.FIND if (picture := session.last_picture) is not None:
                return localize.find(place, picture)
            case JobKind.EXPERIMENT if session.experiments.asked is not None:
                return _begin_experiment(session.experiments.asked, self.runs or RunStore())
            case JobKind.TRACK if job.track is not None:
                return _track(place, job.track)
        raise InvalidInputError(f"there is nothing to {job.kind.value} with")

    def follow(self, session: Session) -> None:
        """Pass the requests of the session on to the flight under way."""
        if self._requests is not None:
            self._requests.follow(session)

    def steps(self, place: Place, query: Query[Any]) -> Generator[None, None, Any]:
        """Answer a query of the page, step by step."""
        return query.steps(self._resources(place))

    def change(self, change: RunChange) -> RunChanged:
        """Rename or delete a stored run; report the problem where that fails."""
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

    def _resources(self, place: Place) -> Resources:
        return Resources(place, self.runs, self.plans, self.navigate)

    def _plan_request(self, session: Session, job: Job, place: Place, planner: str) -> plan.PlanRequest:
        record = replace(session.new_plan(job.ends), planner=planner)
        return plan_request(record, self._resources(place))

    def _fly_request(self, session: Session, job: Job, place: Place, requests: SessionRequests) -> FlyRequest:
        """Request a flight by the settings of the session, with its plan as the first one."""
        settings = session.flight_settings
        made = job.first_plan.latest if job.first_plan is not None else None
        return FlyRequest(
            self._plan_request(session, job, place, session.choice.planner),
            plan=None if made is None else made.motion,
            plan_outcome=None if job.first_plan is None else job.first_plan.outcome,
            cautious=made is None and not job.anyway,
            estimator=session.choice.estimator,
            open_loop=settings.open_loop,
            seed=settings.seed,
            realtime=settings.realtime,
            operator=requests.take,
            surroundings=requests.surroundings,
            source=session.what,
            task=session.task,
            out=None if self.runs is None else self.runs.new(place.name),
        )

    def _georeference(self, session: Session, job: Job, place: Place) -> JobEvents:
        """Georeference the place into a folder of its own, so that all fields before stay available; keep its name.

        A place of the library is there again after a restart, any other one lasts until the app ends.
        """
        from nerfnav_app.jobs.field import georeference  # slow to import, and seldom needed

        if place.source is None:
            raise InvalidInputError(f"{place.name} exists in memory only: open it from a file")
        if (library := PlaceLibrary()).holds(place.source):
            folder = library.new_folder()
        else:
            if self._georeferenced is None:
                self._georeferenced = tempfile.TemporaryDirectory(prefix="nerfnav-", ignore_cleanup_errors=True)
            folder = Path(self._georeferenced.name) / str(job.id)
        out = folder / f"{Path(place.source).stem}.npz"
        return georeference.run(georeference.PlaceRequest(place.source, session.alignment.now.request(), out))


def _begin_experiment(experiment: StartExperiment, runs: RunStore) -> JobEvents:
    """Begin an experiment, whose results are kept beside the runs."""
    out = ExperimentStore(runs.folder).new(experiment.name)
    return run_in_subprocess(partial(_run_experiment, experiment.name, experiment.trials, out))


def _run_experiment(name: str, trials: int | None, out: Path) -> JobEvents:
    from nerfnav_app.jobs.measure import experiment  # slow to import, with its figures

    return experiment.run(experiment.ExperimentRequest(name, trials=trials, out=out))


def _track(place: Place, request: StartTrack) -> JobEvents:
    """Track a camera through the place."""
    # slow to import, and seldom needed
    from nerfnav.tracking import SourceOptions
    from nerfnav_app.jobs.track import track
    from nerfnav_app.jobs.track.camera import GivenCamera
    from nerfnav_app.jobs.track.camera_run import CameraRun

    camera, options = GivenCamera(fov_deg=request.fov_deg), SourceOptions(request.fps)
    return track.watch(place.field, CameraRun(request.source, camera, options))


def _export(session: Session, wish: TrajectoryDownload, place: Place) -> JobEvents:
    """Export the plan, the executed path or the estimate, judged in the field that planners see."""
    recording = make_recording(session, wish.subject)
    if recording is None:
        raise InvalidInputError(f"{wish.subject.title} does not exist yet: plan or fly first")
    planned = prepare_place(place, session.plan_settings.unknown)
    made, name = recording.with_field(planned.field), name_download(session, wish.format, wish.subject)
    return export.download(made, FORMATS[wish.format], name, wish.force, wish.smooth)
