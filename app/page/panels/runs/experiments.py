"""Experiments panel: run an experiment, and show the results of this one and of earlier ones."""

from collections.abc import Callable

import numpy as np
import viser

from nerfnav_app.page.kit.html import heading, note, table
from nerfnav_app.page.kit.widgets import post_on
from nerfnav_app.queries.experiments import Experiments, ExperimentsQuery
from nerfnav_app.state.actions import Command
from nerfnav_app.state.runs import MOST_TRIALS, ListExperiments, ShowResult, StartExperiment
from nerfnav_app.state.session import Session
from nerfnav_app.storage.experiment_store import ExperimentResult
from nerfnav_app.text import capital

_NONE = "none yet"
_FIGURES = 4
_BLANK = np.full((2, 2, 3), 24, np.uint8)


class ExperimentsPanel:
    """Panel of the experiments: a list, a button, numbers and figures."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """Add the widgets; `post` takes the commands."""
        gui = server.gui
        self._post, self._shown, self._listed = post, None, False
        gui.add_html(note("Series of flights or plans, evaluated on the ground truth, with numbers and figures."))
        self._names: viser.GuiDropdownHandle[str] = gui.add_dropdown("Experiment", list[str]([_NONE]))
        self._purpose = gui.add_html("")
        self._count = gui.add_number(
            "Trials", 4, min=1, max=MOST_TRIALS, step=1, hint="More trials are more significant, and slower"
        )
        self._run = gui.add_button("Run the experiment", icon=viser.Icon.FLASK, disabled=True)
        self._results: viser.GuiDropdownHandle[str] = gui.add_dropdown(
            "Results", list[str]([_NONE]), hint="Of earlier experiments, newest first"
        )
        self._report = gui.add_button("Download report", icon=viser.Icon.FILE_REPORT, disabled=True)
        self._figures = [gui.add_image(_BLANK, visible=False) for _ in range(_FIGURES)]
        self._numbers = gui.add_html("")
        self._session: Session | None = None
        self._names.on_update(self._describe)
        self._report.on_click(self._send_report)
        post_on(self._results.on_update, post, self._chosen)
        post_on(self._run.on_click, post, lambda: StartExperiment(self._names.value, int(self._count.value)))

    def _chosen(self) -> ShowResult | None:
        return None if self._results.value == _NONE else ShowResult(self._results.value)

    async def _describe(self, event: viser.GuiEvent) -> None:
        if self._session is not None:
            self._purpose.content = self._purpose_of(self._session)

    async def _send_report(self, event: viser.GuiEvent) -> None:
        known = None if self._session is None else _known(self._session)
        if event.client is not None and known is not None and known.result is not None and known.report is not None:
            event.client.send_file_download(f"{known.result.name}.html", known.report, save_immediately=True)

    def _purpose_of(self, session: Session) -> str:
        purpose = dict(_known(session).known).get(self._names.value, "")
        return note(capital(purpose))

    def show(self, session: Session) -> None:
        """Show the experiments and the selected result."""
        self._session = session
        if session.place is not None and session.job is None and not self._listed:
            self._listed = True
            self._post(ListExperiments())
        there = _known(session)
        self._run.disabled = not there.names or not session.may_begin
        _offer(self._names, there.names)
        self._purpose.content = self._purpose_of(session)
        _offer(self._results, there.earlier)
        self._report.disabled = there.report is None
        result = there.result
        if result is not None and self._results.value != result.name:
            self._results.value = result.name
        if result is not self._shown:
            self._shown = result
            self._draw(result)
        if result is None:
            self._numbers.content = note("Numbers and figures appear here, and stay in the list of results.")

    def _draw(self, result: ExperimentResult | None) -> None:
        figures = result.figures if result is not None else ()
        for index, handle in enumerate(self._figures):
            handle.visible = index < len(figures)
            if index < len(figures):
                handle.image = figures[index]
        if result is not None:
            self._numbers.content = heading("Numbers", result.name) + table(result.numbers)


def _offer(widget: viser.GuiDropdownHandle[str], names: tuple[str, ...]) -> None:
    """Set the options of a list, or a placeholder without any."""
    if widget.options != (names or (_NONE,)):
        widget.options = names or (_NONE,)


def _known(session: Session) -> Experiments:
    """Read the known experiments; none until they are listed."""
    return ExperimentsQuery.result_in(session) or Experiments()
