"""The tab of experiments: one is done, its numbers and figures appear, and stay in the list."""

import json
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from nerfnav_app.jobs.events import JobResult, Progress
from nerfnav_app.places.place import Place
from nerfnav_app.queries.experiments import ExperimentsQuery
from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.server import App
from nerfnav_app.state.job import JobKind
from nerfnav_app.storage.experiment_store import ExperimentStore
from nerfnav_app.storage.run_store import RunStore
from tests.app.doubles import ScriptedWork
from tests.browser.tab import Tab
from tests.waiting import PATIENCE_S

_FIGURE = "() => [...document.images].some(image => image.naturalWidth === 60 && image.naturalHeight === 40)"


@dataclass
class Laboratory(ScriptedWork):
    """An experiment of two trials whose results are in a real folder."""

    folder: Path = Path()

    def answer(self, place: Place, query: Query[Any]) -> Any:
        """What the folder holds."""
        if isinstance(query, ExperimentsQuery):
            return query.answer(Resources(place, RunStore(self.folder)))
        return super().answer(place, query)


def has_result(app: App) -> bool:
    """Whether the session has the numbers of an experiment."""
    known = ExperimentsQuery.result_in(app.session)
    return known is not None and known.result is not None


def test_an_experiment_is_done_and_its_results_are_shown_and_kept(
    serve: Callable[..., App], open_tab: Callable[[App], Tab], tmp_path: Path
) -> None:
    folder = ExperimentStore(tmp_path).folder / "2026-01-02-030405-planners"

    watched = threading.Event()

    def write(job: object) -> JobResult:
        assert watched.wait(PATIENCE_S), "nobody sees that it goes on"
        folder.mkdir(parents=True)
        (folder / "results.json").write_text(json.dumps({"summary": {"failures": 7}}))
        cv2.imwrite(str(folder / "cost.png"), np.full((40, 60, 3), 200, np.uint8))
        return JobResult(files=(folder / "results.json",))

    app = serve(Laboratory({JobKind.EXPERIMENT: [Progress("planning, 1 of 2", 0.5), write]}, folder=tmp_path))
    tab = open_tab(app)
    tab.turn_to("Experiments")
    tab.until(lambda: tab.says("Numbers and figures appear here"), "the panel has no explanation")
    tab.until(lambda: tab.says("Nerfnav, minimum snap and RRT"), "the purpose is not told")
    assert not tab.page.evaluate(_FIGURE)
    tab.press("experiments.run")
    tab.until(lambda: tab.says("Planning, 1 of 2 50 %"), "no progress is shown")
    watched.set()
    tab.until(lambda: has_result(app), "there is no result")
    tab.until(lambda: tab.says("failures"), "the numbers are not shown")
    tab.until(lambda: tab.page.evaluate(_FIGURE), "the figure is not shown")
    with tab.page.expect_download() as download:
        tab.press("experiments.report")
    assert download.value.suggested_filename == "2026-01-02-030405-planners.html"
    report = Path(download.value.path()).read_text()
    assert "failures" in report and "data:image/png" in report
    tab.load()
    tab.turn_to("Experiments")
    tab.until(lambda: tab.says("2026-01-02-030405-planners"), "a reload has lost the result")
