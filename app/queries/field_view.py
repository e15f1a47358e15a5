"""Query for a rendering of the field from a tab's own camera."""

import math
from collections.abc import Hashable, Iterator
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
import torch
import viser.transforms as tf

from nerfnav.field import render_image
from nerfnav.geometry import Camera, Pose
from nerfnav_app.queries.click_landing import LEAST_OPACITY
from nerfnav_app.queries.query import Query, Resources
from nerfnav_app.state.alignment import Correction
from nerfnav_app.state.session import Session
from nerfnav_app.state.view import Backdrop, Eye

WIDTHS = (240, 720)
"""Widths of the renderings for a tab [pixels]: one at once, a finer one if its camera rests."""
_FAR = 150.0  # [m] where there is nothing: as far as the page can tell
_FROM_CV = torch.diag(torch.tensor([1.0, -1.0, -1.0]))  # the page's cameras look along +z, ours along -z


@dataclass(frozen=True)
class FieldView:
    """Rendering of the field from a tab's own camera."""

    image: np.ndarray = field(compare=False)
    """(height, width, 3), sRGB bytes."""
    depth: np.ndarray = field(compare=False)
    """Distance along the camera's axis [m], (height, width)."""


@dataclass(frozen=True)
class FieldViewQuery(Query[FieldView]):
    """Query for a rendering of the field from there."""

    reads_field: ClassVar[bool] = True
    client: int
    """Number of the tab."""
    eye: Eye
    width: int
    """Width of the picture [pixels]."""
    now: Correction
    """Correction that the place is shown with."""

    @property
    def slot(self) -> Hashable:
        """Slot of the tab."""
        return FieldViewQuery, self.client

    @classmethod
    def pending(cls, session: Session) -> Iterator["FieldViewQuery"]:
        """Ask for each tab, while the field itself is the backdrop: coarse at first, then finer."""
        if session.view_settings.backdrop is not Backdrop.RENDER:
            return
        for client, eye in session.eyes.items():
            asked = cls.asked_in(session, (cls, client))
            now = session.alignment.now
            if asked is None or (asked.eye, asked.now) != (eye, now):
                yield cls(client, eye, WIDTHS[0], now)
            elif asked.width < WIDTHS[-1]:
                yield cls(client, eye, WIDTHS[-1], now)

    def answer(self, resources: Resources) -> FieldView:
        """Render the field with its depth."""
        eye, width = self.eye, self.width
        height = max(1, round(width / eye.aspect))
        across = 2 * math.degrees(math.atan(eye.aspect * math.tan(eye.fov / 2)))
        camera = Camera.from_fov(width, height, across)
        rotation = torch.from_numpy(tf.SO3(np.array(eye.wxyz)).normalize().as_matrix()).float() @ _FROM_CV
        pose = self.now.pose_before(Pose(rotation, torch.tensor(eye.position)))
        rendering = render_image(resources.place.field, camera, pose)
        along = -self.now.similarity.scale * camera.directions(camera.pixels())[:, 2].reshape(height, width)
        depth = torch.where(rendering.opacity > LEAST_OPACITY, rendering.depth * along, _FAR)
        return FieldView(rendering.image.numpy(), depth.numpy())

    def apply(self, session: Session, result: FieldView) -> Session:
        """Keep the rendering, unless its tab is closed."""
        return super().apply(session, result) if self.client in session.eyes else session
