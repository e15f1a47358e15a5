"""Overlays to judge a field by: the ground-truth mesh, occupied and unseen voxels, a slice through the density."""

from typing import TYPE_CHECKING

import numpy as np
import viser

from nerfnav_app.page.kit.theme import HIT, STALE, TRUTH
from nerfnav_app.queries.density_slice import DensitySliceQuery
from nerfnav_app.queries.space import Space, SpaceQuery, SpaceVoxels
from nerfnav_app.state.session import Session

if TYPE_CHECKING:
    from nerfnav.world import Scene  # slow to import

_TRUTH_OPACITY = 0.35
_COLORS = {Space.OCCUPIED: HIT, Space.UNKNOWN: STALE}
_NO_POINT = np.zeros((1, 3), np.float32)
_DOT = 0.3  # edge of a square, as a share of its voxel's: the gaps show what is behind


class OverlaysLayer:
    """Layer of the overlays that the view settings select, as soon as they are computed."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._truth = _Truth(server)
        self._spaces = {space: _Voxels(server, space) for space in Space}
        self._slice = _Slice(server)

    def show(self, session: Session) -> None:
        """Draw the selected overlays, and hide the others."""
        place, view = session.place, session.view_settings
        there = place is not None and view.truth and not session.alignment.is_moving
        self._truth.show(place.scene if place is not None and there else None)
        wanted = {Space.OCCUPIED: view.occupied, Space.UNKNOWN: view.unknown}
        for space, voxels in self._spaces.items():
            voxels.show(SpaceQuery.result_in(session, (SpaceQuery, space)) if wanted[space] else None)
        self._slice.show(session)


class _Truth:
    """The ground-truth mesh, see-through."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._server = server
        self._node: viser.MeshHandle | None = None
        self._shown: Scene | None = None

    def show(self, scene: "Scene | None") -> None:
        if scene is not None and scene is not self._shown:
            self._shown = scene
            self._node = self._server.scene.add_mesh_simple(
                "/truth",
                np.asarray(scene.mesh.vertices, np.float32),
                np.asarray(scene.mesh.faces, np.uint32),
                color=TRUTH,
                opacity=_TRUTH_OPACITY,
                flat_shading=True,
                side="double",
                cast_shadow=False,
                receive_shadow=False,
            )
        if self._node is not None:
            self._node.visible = scene is not None


class _Voxels:
    """A part of space as a cloud of squares."""

    def __init__(self, server: viser.ViserServer, space: Space) -> None:
        self._node = server.scene.add_point_cloud(
            f"/space/{space.name.lower()}", _NO_POINT, _COLORS[space], precision="float32", visible=False
        )
        self._shown: SpaceVoxels | None = None

    def show(self, voxels: SpaceVoxels | None) -> None:
        drawn = voxels is not None and len(voxels.centers) > 0
        if voxels is not None and drawn and voxels is not self._shown:
            self._shown = voxels
            self._node.points, self._node.point_size = voxels.centers.astype(np.float32), _DOT * voxels.spacing
        self._node.visible = drawn


class _Slice:
    """The slice as a picture that lies in the scene."""

    def __init__(self, server: viser.ViserServer) -> None:
        self._node = server.scene.add_image(
            "/slice", np.zeros((2, 2, 4), np.uint8), 1.0, 1.0, format="png", visible=False,
            cast_shadow=False, receive_shadow=False,
        )  # fmt: skip
        self._shown: np.ndarray | None = None

    def show(self, session: Session) -> None:
        wanted = session.view_settings.slice is not None and not session.alignment.is_moving
        query, image = DensitySliceQuery.asked_in(session), DensitySliceQuery.result_in(session)
        if wanted and query and image is not None and session.place is not None and image is not self._shown:
            self._shown = image
            box = session.place.field.box
            width, depth, height = box.size.tolist()
            # pictures have rows downwards: y falls along them, x grows along columns
            self._node.image = np.ascontiguousarray(image.transpose(1, 0, 2)[::-1])
            self._node.render_width, self._node.render_height = width, depth
            x, y, _ = box.center.tolist()
            self._node.position = (x, y, box.lower[2].item() + query.share * height)
        self._node.visible = wanted and image is not None
