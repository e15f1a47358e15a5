"""View settings panel: the backdrop of the place, overlays on it, and the camera."""

from collections.abc import Callable

import viser

from nerfnav.field import VoxelField
from nerfnav_app.page.kit.html import scale
from nerfnav_app.page.kit.theme import CLEARANCE_CM, apply_brightness
from nerfnav_app.page.kit.widgets import Binder
from nerfnav_app.state.actions import Command, Settings
from nerfnav_app.state.session import Session
from nerfnav_app.state.view import Backdrop, CameraMode

_BACKDROPS = {backdrop.value: backdrop for backdrop in Backdrop}
_CAMERAS = {mode.value: mode for mode in CameraMode}
_SHOWN_AT_FIRST = 0.3  # share of the height of a slice that was not drawn yet


class ViewSettingsPanel:
    """Panel of `ViewSettings`, except those of flights."""

    def __init__(self, server: viser.ViserServer, post: Callable[[Command], None]) -> None:
        """Add the widgets; `post` takes the commands."""
        self._server, self._lit = server, False
        with server.gui.add_folder("View", expand_by_default=False):
            gui = server.gui
            self._camera: viser.GuiDropdownHandle[str] = gui.add_dropdown(
                "Camera view", list[str](_CAMERAS), hint="Keys 1 to 4"
            )
            self._backdrop: viser.GuiDropdownHandle[str] = gui.add_dropdown(
                "Field",
                list[str](_BACKDROPS),
                hint="The surface draws fast; the field itself is rendered as the robot sees it",
            )
            self._opacity = gui.add_slider("Opacity [%]", 5.0, 100.0, 5.0, 100.0, hint="Of the surface")
            self._clip = gui.add_slider("Cut above [%]", 5.0, 100.0, 5.0, 100.0, hint="Of the height of the place")
            self._truth = gui.add_checkbox("Ground truth", False, hint="Draw the mesh that collisions are counted with")
            self._occupied = gui.add_checkbox(
                "Occupied", False, hint="Draw voxels in which the robot's body does not fit"
            )
            self._unknown = gui.add_checkbox("Unknown", False, hint="Draw space that no camera saw: planners avoid it")
            self._sliced = gui.add_checkbox("Density slice", False, hint="Draw the density at one height")
            self._height = gui.add_slider("Slice at [%]", 0.0, 100.0, 1.0, 30.0, hint="Of the height of the place")
            self._plan = gui.add_checkbox("Plan", True, hint="Draw the plan; in a flight dashes are its first plan")
            self._executed = gui.add_checkbox("Executed path", True, hint="Draw where the robot truly was")
            self._estimate = gui.add_checkbox("Estimate", True, hint="Draw where the robot believed to be")
            self._clearance = gui.add_checkbox(
                "Line by clearance", False, hint="Colour the plan by the robot's clearance"
            )
            self._scale = gui.add_html(scale(*CLEARANCE_CM, "cm of clearance"), visible=False)
            self._light = gui.add_checkbox("Light panels", False, hint="The scene stays dark: its lines need contrast")
        bind = Binder(Settings.VIEW, post)
        bind(self._camera, "camera", _CAMERAS.__getitem__)
        bind(self._light, "light", bool)
        bind(self._clearance, "clearance", bool)
        bind(self._plan, "plan", bool)
        bind(self._executed, "executed", bool)
        bind(self._estimate, "estimate", bool)
        bind(self._backdrop, "backdrop", _BACKDROPS.__getitem__)
        bind(self._opacity, "opacity", _share)
        bind(self._clip, "clip", _share)
        bind(self._truth, "truth", bool)
        bind(self._occupied, "occupied", bool)
        bind(self._unknown, "unknown", bool)
        bind(self._sliced, "slice", lambda value: _SHOWN_AT_FIRST if value else None)
        bind(self._height, "slice", _share)

    def show(self, session: Session) -> None:
        """Copy the session's view settings into the widgets."""
        view, place = session.view_settings, session.place
        splats = place is not None and place.splats is not None
        choices = tuple(name for name, backdrop in _BACKDROPS.items() if splats or backdrop is not Backdrop.SPLATS)
        if self._backdrop.options != choices:
            self._backdrop.options = choices
        self._camera.value, self._light.value = view.camera.value, view.light
        if view.light != self._lit:
            self._lit = view.light
            apply_brightness(self._server, view.light)
        self._backdrop.value = view.backdrop.value
        self._plan.value, self._executed.value, self._estimate.value = view.plan, view.executed, view.estimate
        self._clearance.value = self._scale.visible = view.clearance
        self._opacity.value, self._clip.value = round(100 * view.opacity), round(100 * view.clip)
        self._opacity.visible = self._clip.visible = view.backdrop is Backdrop.SURFACE
        self._truth.value, self._occupied.value, self._unknown.value = view.truth, view.occupied, view.unknown
        self._truth.visible = place is not None and place.truth is not None
        field = None if place is None else place.field
        self._unknown.visible = isinstance(field, VoxelField) and field.unknown is not None
        self._sliced.value, self._height.visible = view.slice is not None, view.slice is not None
        if view.slice is not None:
            self._height.value = round(100 * view.slice)


def _share(percent: float) -> float:
    return 0.01 * float(percent)
