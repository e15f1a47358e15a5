"""How long plans take and what they weigh: one widget for each number."""

from collections.abc import Callable
from dataclasses import fields
from typing import Any

import viser

from nerfnav.field import Unknown
from nerfnav.planner import CostWeights
from nerfnav_app.page.panels.binder import Binder
from nerfnav_app.state.actions import Command, Settings
from nerfnav_app.state.session import Session
from nerfnav_app.text import capital

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
        self._accepted = gui.add_number(
            "Accepted risk [%]", 100.0, step=0.1, hint="Largest bound on the probability of a collision; 100: any"
        )
        self._free = gui.add_checkbox(
            "Unseen space is free", False, hint="Plan through what no photograph shows; else it is taken for solid"
        )
        bind, weigh = Binder(Settings.PLAN, post), Binder(Settings.WEIGHTS, post)
        bind(self._duration, "duration_s", float)
        bind(self._shortest, "shortest", bool)
        bind(self._accepted, "max_collision", lambda percent: None if percent >= 100 else 0.01 * float(percent))
        bind(self._free, "unknown", lambda free: Unknown.FREE if free else Unknown.OCCUPIED)
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
        accepted = settings.max_collision
        self._accepted.value = 100.0 if accepted is None else round(100 * accepted, 6)
        self._free.value = settings.unknown is Unknown.FREE
        for name, widget in self._weights.items():
            widget.value = getattr(settings.weights, name)
