"""A list of names, one of which is taken: robots, planners, estimators."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import viser

from nerfnav import robots
from nerfnav_app.state.actions import Choose, Command
from nerfnav_app.state.session import Session
from nerfnav_app.text import capital

_LABELS = {
    "planner": {
        "fast": "quick",
        "paper": "as in the paper, slow",
        "minsnap": "minimum snap",
        "rrt": "random tree (RRT)",
    },
    "estimator": {"fast": "quick", "paper": "as in the paper, slow"},
}
"""What people read in place of a name; names that are not here are read as they are."""


def label_of(name: str) -> str:
    """A name as people read it: of a robot's file no more than what it is called."""
    return Path(name).stem if robots.is_file(name) else name


class ChoiceList:
    """The dropdown of one field of `Choice`."""

    def __init__(
        self, server: viser.ViserServer, field: str, names: Iterable[str], hint: str, post: Callable[[Command], None]
    ) -> None:
        """`field` is the name of the field, whose values are among `names`; `post` takes what the user asks."""
        self._field, self._post = field, post
        self._session: Session | None = None
        labels = _LABELS.get(field, {})
        self._names = {labels.get(name) or label_of(name): name for name in names}
        self._labels = {name: label for label, name in self._names.items()}
        self._list: viser.GuiDropdownHandle[str] = server.gui.add_dropdown(
            capital(field), list[str](self._names), hint=hint
        )
        self._list.on_update(self._take)

    async def _take(self, event: viser.GuiEvent) -> None:
        if event.client is not None and self._session is not None:
            self._post(Choose(replace(self._session.choice, **{self._field: self._names[str(self._list.value)]})))

    def show(self, session: Session) -> None:
        """Show what is chosen."""
        self._session = session
        chosen = getattr(session.choice, self._field)
        if chosen not in self._labels:  # the robot of a file, by which a stored flight was flown
            self._labels[chosen] = label_of(chosen)
            self._names[label_of(chosen)] = chosen
            self._list.options = list[str](self._names)
        self._list.value = self._labels[chosen]
