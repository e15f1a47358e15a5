"""Widgets that several panels use: posts of commands, a binder, a choice list, a dialog.

A binder turns a widget's value into a command that changes one number of the settings. A choice list selects a robot,
a planner or an estimator, by the name that it has everywhere. The dialogs confirm a deletion and a reset.
"""

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

import viser

from nerfnav import robots
from nerfnav_app.page.kit.html import note
from nerfnav_app.state.actions import Adjust, Choose, Command, Reset, Settings
from nerfnav_app.state.session import Session
from nerfnav_app.text import capital


def post_on(
    listen: Callable[[Callable[[Any], Any]], Any],
    post: Callable[[Command], None],
    make: Callable[[], Command | None],
) -> None:
    """Post the command that `make` builds, if any, whenever a user clicks or changes a widget.

    `listen` is the widget's `on_click`, `on_update` or `on_trigger`; changes by the session itself post nothing.
    """

    async def take(event: Any) -> None:
        command = None if event.client is None else make()
        if command is not None:
            post(command)

    listen(take)


class Binder:
    """Binder of widgets to one kind of settings."""

    def __init__(self, settings: Settings, post: Callable[[Command], None]) -> None:
        """Bind to these settings; `post` takes the commands."""
        self._settings, self._post = settings, post

    def __call__(self, widget: Any, name: str, read: Callable[[Any], Any]) -> None:
        """Let `widget` set the field `name`; `read` converts the widget's value to that of the field."""
        post_on(widget.on_update, self._post, lambda: Adjust(self._settings, name, read(widget.value)))


def format_name(name: str) -> str:
    """Format the name of a robot: of a file its stem alone."""
    return Path(name).stem if robots.is_file(name) else name


class ChoiceList:
    """Dropdown of one field of `Choice`."""

    def __init__(
        self, server: viser.ViserServer, field: str, names: Iterable[str], hint: str, post: Callable[[Command], None]
    ) -> None:
        """Add the dropdown of the field `field`, whose values are `names`; `post` takes the commands."""
        self._field = field
        self._session: Session | None = None
        self._names = {format_name(name): name for name in names}
        self._labels = {name: label for label, name in self._names.items()}
        self._list: viser.GuiDropdownHandle[str] = server.gui.add_dropdown(
            capital(field), list[str](self._names), hint=hint
        )
        post_on(self._list.on_update, post, self._chosen)

    def _chosen(self) -> Choose | None:
        if self._session is None:
            return None
        return Choose(replace(self._session.choice, **{self._field: self._names[str(self._list.value)]}))

    def show(self, session: Session) -> None:
        """Show the selected name."""
        self._session = session
        chosen = getattr(session.choice, self._field)
        if chosen not in self._labels:  # the robot of a file, by which a stored flight was flown
            self._labels[chosen] = format_name(chosen)
            self._names[format_name(chosen)] = chosen
            self._list.options = list[str](self._names)
        self._list.value = self._labels[chosen]


def confirm_deletion(client: viser.ClientHandle, what: str, warning: str, really: Callable[[], None]) -> None:
    """Ask for a confirmation in the tab that deletes; `what` is "this flight", `warning` names what is lost.

    `really` is called on a thread of the server's pool.
    """
    _confirm(client, f"Delete {what}?", warning, ("Delete for good", "Keep it"), really)


def confirm_reset(client: viser.ClientHandle, post: Callable[[Command], None]) -> None:
    """Ask for a confirmation in the tab that resets, and post the reset."""
    warning = "Ends and all settings return to those at opening. Undo brings them and the plan back."
    _confirm(client, "Reset everything?", warning, ("Reset all", "Keep all"), lambda: post(Reset()))


def _confirm(
    client: viser.ClientHandle, question: str, warning: str, answers: tuple[str, str], really: Callable[[], None]
) -> None:
    """Ask a question in a dialogue of a tab; the first of the `answers` calls `really`."""
    modal = client.gui.add_modal(question)
    with modal:
        client.gui.add_html(note(warning))
        yes = client.gui.add_button(answers[0], color="red")
        no = client.gui.add_button(answers[1], color="gray")

    @yes.on_click
    def _(_: viser.GuiEvent) -> None:
        really()
        modal.close()

    @no.on_click
    async def _(_: viser.GuiEvent) -> None:
        modal.close()
