"""What several tests of the app begin with: a field file that needed no training, a session whose place is open."""

from pathlib import Path

import pytest
import torch

from nerfnav.field.core.info import FieldInfo
from nerfnav.field.models.voxel import EMPTY_RAW, VoxelField
from nerfnav.field.storage.checkpoint import save_field
from nerfnav.geometry.box import Box
from nerfnav_app.jobs.events import JobFinished, PlaceOpened
from nerfnav_app.queries.first_ends import FirstEnds, FirstEndsQuery
from nerfnav_app.queries.place_list import PlaceListQuery
from nerfnav_app.queries.run_list import RunListQuery
from nerfnav_app.state import actions as m
from nerfnav_app.state.session import Session
from tests.app.doubles import balls_place
from tests.app.sessions import after, reports


@pytest.fixture(scope="session")
def field_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A field of 2 m x 2 m x 1 m with a column of 0.4 m in its middle and colours that vary with the position."""
    values = torch.full((41, 41, 21, 4), EMPTY_RAW)
    values[16:25, 16:25, :, 0] = 1.0
    x, y, z = torch.meshgrid(*(torch.linspace(0, 6, count) for count in values.shape[:3]), indexing="ij")
    values[..., 1:] = 0.5 + 0.4 * torch.stack([x, y, z], -1).sin()
    box = Box.of((-1, -1, 0), (1, 1, 1))
    path = tmp_path_factory.mktemp("fields") / "column.npz"
    save_field(VoxelField(box, values, torch.ones(3), FieldInfo(source="a test", psnr_db=30.0)), path)
    return path


@pytest.fixture(scope="module")
def opened() -> Session:
    """A session whose place is open and idle, and whose shelf and library are known to be empty."""
    session = reports(Session.opening("balls"), PlaceOpened(balls_place()), JobFinished("open"))
    for query in FirstEndsQuery.pending(session):
        session = after(session, m.QueryAnswered(query, FirstEnds(session.ends)))
    lists = (*RunListQuery.pending(session), *PlaceListQuery.pending(session))
    return after(session, *(m.QueryAnswered(query, ()) for query in lists))
