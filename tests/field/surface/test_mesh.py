"""The level set of a field as a mesh."""

import torch

from nerfnav.field.models.analytic import BallsField
from nerfnav.field.surface.mesh import field_mesh
from tests.field.fields import BOX, ball


def test_the_mesh_of_a_ball_is_a_closed_ball_that_faces_outwards():
    mesh = field_mesh(ball(), spacing=0.02)
    assert mesh.is_watertight
    assert abs(mesh.volume / (4 / 3 * 3.14159 * 0.313**3) - 1) < 0.05  # density 50 lies a little outside 0.3
    assert abs(mesh.bounds[1][0] - 0.31) < 0.01


def test_a_body_cut_by_the_box_is_closed_at_the_border():
    cut = BallsField(BOX, torch.tensor([[1.0, 0.0, 0.0]]), torch.tensor([0.4]))
    assert field_mesh(cut, spacing=0.03).is_watertight


def test_vertices_have_the_fields_colours():
    mesh = field_mesh(ball(), spacing=0.03)
    points = torch.tensor(mesh.vertices, dtype=torch.float32)
    wanted = ball().radiance(points, points) * 255
    seen = torch.tensor(mesh.visual.vertex_colors[:, :3]).float()
    assert (seen - wanted).abs().mean() < 25


def test_an_empty_field_has_an_empty_mesh():
    nothing = BallsField(BOX, torch.zeros(1, 3), torch.tensor([0.3]), peak=0.0)
    assert len(field_mesh(nothing, spacing=0.05).faces) == 0
