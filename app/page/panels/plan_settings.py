"""How long plans take and what they weigh: one widget for each number."""

from collections.abc import Callable
from dataclasses import fields
from typing import Any

import viser

from app.page.panels.binder import Binder
from app.state.actions import Command, Settings
from app.state.session import Session
from app.text import capital
from nerfnav.planner import CostWeights

_UNITS = {"outside": "1/m²", "margin": "m", "risk": "J"}


class PlanningPanel:
    """The widgets of `PlanSettings`; those of the weights are made from the record's own fields."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """`post` takes what the user asks."""
        gui = server.gui
        self._duration = gui.add_number("Duration [s]", 2.0, step=0.1, hint="From start to goal, rest to rest")
        self._shortest = gui.add_checkbox(
            "Find the shortest duration", False, hint="Minimum time: the least in which the robot keeps its limits"
        )
        bind, weigh = Binder(Settings.PLAN, post), Binder(Settings.WEIGHTS, post)
        bind(self._duration, "duration_s", float)
        bind(self._shortest, "shortest", bool)
        self._weights: dict[str, viser.GuiInputHandle[Any]] = {}
        with gui.add_folder("Weights", expand_by_default=False):
            for part in fields(CostWeights):
                name = capital(part.name.replace("_", " "))
                unit = f" [{_UNITS[part.name]}]" if part.name in _UNITS else ""
                self._weights[part.name] = widget = gui.add_number(name + unit, getattr(CostWeights(), part.name))
                weigh(widget, part.name, type(getattr(CostWeights(), part.name)))

    def show(self, session: Session) -> None:
        """Put the session's settings into the widgets."""
        settings = session.plan_settings
        self._duration.value, self._shortest.value = settings.duration_s, settings.shortest
        for name, widget in self._weights.items():
            widget.value = getattr(settings.weights, name)
