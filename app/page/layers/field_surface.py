"""Surface of the field as a mesh, and the first view of it.

Imports nothing slow: a surface that was kept is shown while all else is being imported.
"""

from typing import TYPE_CHECKING

import viser
import viser.transforms as tf

from nerfnav_app.places.surface_glb import Corner, clip_and_fade, read_box, split_glb
from nerfnav_app.places.vantage import FOV, View, view_of_box
from nerfnav_app.state.view import Backdrop, ViewSettings, to_point

if TYPE_CHECKING:
    from nerfnav.obstacles import CutOut
    from nerfnav_app.state.alignment import Correction
    from nerfnav_app.state.session import Session


class FieldSurfaceLayer:
    """Layer of the field's surface, unlit: the colours contain the light."""

    def __init__(self, server: viser.ViserServer, surface: bytes | None = None) -> None:
        """Show `surface` at once, before there is a session."""
        self.server = server
        self._shown: tuple[bytes | None, float, float, tuple[CutOut, ...]] | None = None
        self._node: viser.GlbHandle | None = None
        self._framed: tuple[Corner, Corner] | None = None
        self._viewed: View | None = None
        if surface is not None:
            self._frame(read_box(surface))
            self._draw(surface, ViewSettings())

    @property
    def surface(self) -> bytes | None:
        """The surface that is shown now, as binary glTF."""
        return None if self._shown is None else self._shown[0]

    def show(self, session: "Session") -> None:
        """Add the surface once it is extracted, and look at the box once it is known."""
        if session.place is not None:
            box = session.place.field.box
            self._frame((box.lower.tolist(), box.upper.tolist()))
            if session.view is not None and session.view != self._viewed:
                self._viewed = session.view
                look(self.server, session.view)
        elif session.surface is not None and session.surface is not self.surface:  # before there is a field
            self._frame(read_box(session.surface))
        cuts = tuple(shape for placed in session.visible_obstacles if (shape := placed.cut_out) is not None)
        self._draw(session.surface, session.view_settings, cuts)
        if self._node is not None:
            lay(self._node, session.alignment.now)

    def _frame(self, box: tuple[Corner, Corner] | None) -> None:
        """Look at another box."""
        if box is not None and box != self._framed:
            self._framed = box
            look(self.server, first_view(box))

    def _draw(self, surface: bytes | None, settings: ViewSettings, cuts: "tuple[CutOut, ...]" = ()) -> None:
        """Draw a surface without the parts that were cut out of it."""
        before, self._shown = self._shown, (surface, settings.opacity, settings.clip, cuts)
        if self._shown != before:
            drawn = None if surface is None else clip_and_fade(surface, settings.opacity, settings.clip)
            for shape in cuts:
                drawn = None if drawn is None else split_glb(drawn, shape, inside=False)
            self._put(drawn)
        if self._node is not None:
            self._node.visible = settings.backdrop is Backdrop.SURFACE

    def _put(self, glb: bytes | None) -> None:
        if glb is None:  # another place is being opened
            if self._node is not None:
                self._node.remove()
            self._node = None
        elif self._node is None:
            self._node = self.server.scene.add_glb("/field", glb, cast_shadow=False, receive_shadow=False)
        else:
            self._node.glb_data = glb


def lay(node: viser.GlbHandle | viser.GaussianSplatHandle, now: "Correction") -> None:
    """Draw the place where its correction by hand leaves it."""
    similarity = now.similarity
    node.scale = similarity.scale
    node.position = to_point(similarity.translation)
    node.wxyz = tf.SO3.from_matrix(similarity.rotation.numpy()).wxyz


def first_view(box: tuple[Corner, Corner]) -> View:
    """Compute the view of all of a box between two corners [m]."""
    return view_of_box(*map(to_point, box))


def look(server: viser.ViserServer, view: View) -> None:
    """Set the camera of all tabs, and of those that open later."""
    for camera in (server.initial_camera, *(client.camera for client in server.get_clients().values())):
        camera.position, camera.look_at = view
        camera.fov = FOV
