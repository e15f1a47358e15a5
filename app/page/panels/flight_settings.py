"""How the next flight is flown: seed, noise, speed, with open eyes or blindly."""

from collections.abc import Callable

import numpy as np
import viser

from nerfnav.navigation import WorldName
from nerfnav_app.page.panels.binder import Binder
from nerfnav_app.state.actions import Command, Settings
from nerfnav_app.state.session import Session
from nerfnav_app.state.settings import LARGEST_SEED

_SPEEDS = {"as fast as it can": 0.0, "real time": 1.0, "half": 0.5, "a quarter": 0.25}

_WORLDS: dict[str, WorldName] = {"the paper's noise": "paper", "wind and motors": "physical"}


class FlyingPanel:
    """The widgets of `FlightSettings`."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """`post` takes what the user asks."""
        with server.gui.add_folder("Settings", expand_by_default=False):
            self._speed: viser.GuiDropdownHandle[str] = server.gui.add_dropdown(
                "Speed", list[str](_SPEEDS), hint="Counts at once, also while flying"
            )
            self._world: viser.GuiDropdownHandle[str] = server.gui.add_dropdown(
                "World", list[str](_WORLDS), hint="Wind and motors: a quadrotor of 250 g in wind of 2 m/s"
            )
            self._realtime = server.gui.add_checkbox(
                "World does not wait", False, hint="Steps that take longer than their time are late, and counted"
            )
            self._seed = server.gui.add_number(
                "Seed", 0, min=0, max=LARGEST_SEED, step=1, hint="Of the noise and of the first belief"
            )
            self._position = server.gui.add_slider(
                "Push [cm]", 0.0, 10.0, 0.5, 2.0, hint="Standard deviation of each coordinate at each time step"
            )
            self._attitude = server.gui.add_slider(
                "Twist [°]", 0.0, 10.0, 0.1, 1.1, hint="Standard deviation of the attitude at each time step"
            )
            self._blind = server.gui.add_checkbox(
                "Blindly", False, hint="Fly the first plan without looking, for comparison"
            )
        bind = Binder(Settings.FLIGHT, post)
        bind(self._speed, "pace", _SPEEDS.__getitem__)
        bind(self._world, "world", _WORLDS.__getitem__)
        bind(self._realtime, "realtime", bool)
        bind(self._seed, "seed", round)
        bind(self._position, "position_noise_m", lambda value: 0.01 * float(value))
        bind(self._attitude, "attitude_noise_rad", lambda value: float(np.deg2rad(value)))
        bind(self._blind, "open_loop", bool)

    def show(self, session: Session) -> None:
        """Put the session's settings into the widgets."""
        settings = session.flight_settings
        self._speed.value = next((name for name, pace in _SPEEDS.items() if pace == settings.pace), self._speed.value)
        self._world.value = next(name for name, world in _WORLDS.items() if world == settings.world)
        self._realtime.value = settings.realtime
        self._position.disabled = self._attitude.disabled = settings.world == "physical"
        self._seed.value = settings.seed
        self._position.value = round(100 * settings.position_noise_m, 2)
        self._attitude.value = round(float(np.rad2deg(settings.attitude_noise_rad)), 1)
        self._blind.value = settings.open_loop
