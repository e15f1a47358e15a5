"""Export panel: download the plan, the executed path or the estimate in one of the formats."""

from collections.abc import Callable
from typing import Any

import viser

from nerfnav.core.errors import NerfnavError
from nerfnav.export import FORMATS, ExportFormat, Refusal, Remedy, Subject
from nerfnav_app.page.kit.html import note, warning
from nerfnav_app.state.actions import Command, Notify
from nerfnav_app.state.export_subject import (
    choose_subject,
    find_refusal,
    has_flight,
    list_subjects,
    make_recording,
    name_download,
)
from nerfnav_app.state.job import TrajectoryDownload
from nerfnav_app.state.session import Session
from nerfnav_app.text import sentence

_LABELS = {Subject.PLAN: "Plan", Subject.EXECUTED: "Executed path", Subject.ESTIMATE: "Estimate"}
_SUBJECTS = {label: subject for subject, label in _LABELS.items()}
_NOTHING = "Nothing to export yet: plan or fly first."
_ADVICE = {
    Remedy.PLAN: "export the plan",
    Remedy.SMOOTH: "tick Smooth",
    Remedy.REPLAN: "plan with more room or time",
    Remedy.FORCE: "tick Export anyway",
}
"""Offer of the page for each remedy."""


class ExportPanel:
    """Panel that exports what was planned, executed and estimated."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """Add the widgets; `post` takes the commands."""
        self._post = post
        self._session: Session | None = None
        self._default_of = ""
        self._past: Refusal | None = None
        self._nothing = server.gui.add_html(note(_NOTHING))
        self._format: viser.GuiDropdownHandle[str] = server.gui.add_dropdown("Format", list(FORMATS), visible=False)
        self._subject: viser.GuiDropdownHandle[str] = server.gui.add_dropdown(
            "Subject", list(_SUBJECTS), visible=False, hint="The first plan, where the robot was, or where it believed"
        )
        self._purpose = server.gui.add_html("", visible=False)
        self._smooth = server.gui.add_checkbox(
            "Smooth", False, visible=False, hint="A vehicle follows a smooth curve near it, which is judged first"
        )
        self._force = server.gui.add_checkbox("Export anyway", False, visible=False)
        self._download = server.gui.add_button("Download", icon=viser.Icon.DOWNLOAD, visible=False)
        self._refusal = server.gui.add_html("", visible=False)
        self._plan = server.gui.add_button("Export the plan", icon=viser.Icon.DOWNLOAD, visible=False)
        self._format.on_update(self._select)
        self._subject.on_update(self._select)
        self._download.on_click(self._send)
        self._plan.on_click(self._send_plan)

    def show(self, session: Session) -> None:
        """Show the subjects of the export and the formats for them."""
        self._session = session
        subjects = list_subjects(session)
        for handle in (self._format, self._subject, self._purpose, self._download):
            handle.visible = bool(subjects)
        self._nothing.visible = not subjects
        names = tuple(formats_for(subjects))
        if self._format.options != names:
            before = self._format.value
            self._format.options = names
            self._format.value = before if before in names else names[0]
        self._describe()

    @property
    def _chosen(self) -> Subject:
        """The selected subject; a page can send any name."""
        return _SUBJECTS.get(str(self._subject.value), Subject.PLAN)

    async def _select(self, event: viser.GuiEvent[Any]) -> None:
        self._describe()

    def _describe(self) -> None:
        session, form = self._session, FORMATS[self._format.value]
        if session is None:
            return
        self._offer_subjects(session, form)
        subject = self._chosen
        refusal = find_refusal(session, subject, form)
        refusal = None if refusal is self._past else refusal
        self._purpose.content = note(sentence(f"{form.purpose} (.{form.ending})"))
        smoothed = form.moves_vehicle and subject is not Subject.PLAN
        for checkbox, fits in ((self._smooth, smoothed), (self._force, refusal is not None or form.moves_vehicle)):
            checkbox.visible = fits and bool(list_subjects(session))
            if not fits and checkbox.value:
                checkbox.value = False
        self._show_refusal(refusal)

    def _offer_subjects(self, session: Session, form: ExportFormat) -> None:
        """Offer the subjects that the format can hold; take its default when format or subjects change."""
        offered = tuple(_LABELS[each] for each in list_subjects(session) if each in form.subjects)
        if not offered:
            return
        before, now = self._chosen, f"{form.name} of a {'flight' if has_flight(session) else 'plan'}"
        if self._subject.options != offered:
            self._subject.options = offered
        chosen = before if now == self._default_of else choose_subject(session, form)
        self._default_of = now
        label = _LABELS[chosen] if _LABELS[chosen] in offered else offered[0]
        if self._subject.value != label:
            self._subject.value = label

    def _show_refusal(self, refusal: Refusal | None) -> None:
        """Show a refusal, and the button that helps."""
        self._refusal.visible = refusal is not None
        self._plan.visible = refusal is not None and Remedy.PLAN in refusal.remedies
        if refusal is not None:
            self._refusal.content = warning(tell_refusal(refusal))

    def _send_plan(self, event: viser.GuiEvent[Any]) -> None:
        """Send the plan in the place of what was refused."""
        self._subject.value = _LABELS[Subject.PLAN]
        self._describe()
        self._send(event)

    def _send(self, event: viser.GuiEvent[Any]) -> None:
        """Send the file to the tab that requests it; runs on a thread of the server's pool."""
        session, form, subject = self._session, FORMATS[self._format.value], self._chosen
        if event.client is None or session is None:
            return
        made = make_recording(session, subject)
        if made is None:
            self._post(Notify("Nothing to export", "Plan or fly first.", bad=True))
            return
        if form.moves_vehicle:  # the worker first checks trajectories of vehicles in the field
            force, smooth = self._force.value, self._smooth.value
            self._post(TrajectoryDownload(form.name, event.client.client_id, subject, force, smooth))
            return
        try:
            content = form.exported(made, self._force.value).content
        except NerfnavError as error:
            self._post(Notify("Not exported", sentence(str(error)), bad=True))
        else:
            self._past = session.export_refusal  # a success takes it away
            name = name_download(session, form.name, subject)
            event.client.send_file_download(name, content, save_immediately=True)


def tell_refusal(refusal: Refusal) -> str:
    """Tell subject, format, reason and what the page offers."""
    return f"{sentence(refusal.reason)} {sentence(', or '.join(_ADVICE[remedy] for remedy in refusal.remedies))}"


def formats_for(subjects: tuple[Subject, ...]) -> dict[str, ExportFormat]:
    """Select the formats that can hold one of the subjects, without those that need a place on Earth."""
    known = subjects or (Subject.PLAN,)
    return {name: form for name, form in FORMATS.items() if not form.needs_datum and set(known) & set(form.subjects)}
