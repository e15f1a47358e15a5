"""Volume rendering against closed forms."""

import math

import torch

from nerfnav.field.core.protocol import box_interval, chosen_samples, uniform_samples
from nerfnav.field.render.volume_rendering import Rendering, render_image, render_rays
from nerfnav.geometry.camera import Camera, look_at
from tests.field.fields import BOX, ball


def test_rays_enter_and_leave_the_box_where_they_should():
    origins = torch.tensor([[-3.0, 0.0, 0.0], [0.0, 0.0, 0.0], [-3.0, 5.0, 0.0]])
    directions = torch.tensor([[1.0, 0.0, 0.0]]).expand(3, 3)
    enter, leave = box_interval(BOX, origins, directions)
    torch.testing.assert_close(enter[:2], torch.tensor([2.0, 0.0]))
    torch.testing.assert_close(leave[:2], torch.tensor([4.0, 1.0]))
    assert leave[2] < enter[2]


def test_samples_lie_inside_the_box_and_cover_the_ray():
    origins, directions = torch.tensor([[-3.0, 0.1, 0.0]]), torch.tensor([[1.0, 0.0, 0.0]])
    samples = uniform_samples(BOX, origins, directions, 0.01)
    assert samples.mask.sum() == 200
    assert samples.distances[samples.mask].min() > 2 and samples.distances.max() < 4


def test_samples_of_chosen_bins_stand_in_rows_as_short_as_they_can_be():
    chosen = torch.tensor([[0, 1, 0, 0, 1], [1, 0, 0, 0, 0], [0, 0, 0, 0, 0]], dtype=torch.bool)
    samples = chosen_samples(chosen, torch.tensor([2.0, 3.0, 4.0]), 0.1)
    assert samples.mask.tolist() == [[True, True], [True, False], [False, False]]
    torch.testing.assert_close(samples.distances, torch.tensor([[2.15, 2.45], [3.05, 0.0], [0.0, 0.0]]))


def test_a_rendering_as_a_photograph_has_whole_levels_and_none_beyond_full_scale():
    color = torch.tensor([[0.0, 0.5, 1.0], [-0.2, 1.7, 100.4 / 255]])
    seen = Rendering(color, torch.ones(2), torch.ones(2))
    assert seen.image.tolist() == [[0, 128, 255], [0, 255, 100]]


def test_a_ray_through_the_ball_is_stopped_at_its_skin():
    rendering = render_rays(ball(), torch.tensor([[-0.9, 0.0, 0.0]]), torch.tensor([[1.0, 0.0, 0.0]]))
    assert rendering.opacity.item() > 0.99
    assert abs(rendering.depth.item() - 0.6) < 0.02


def test_a_ray_past_the_ball_sees_the_background():
    rendering = render_rays(ball(), torch.tensor([[-0.9, 0.9, 0.0]]), torch.tensor([[1.0, 0.0, 0.0]]))
    torch.testing.assert_close(rendering.color[0], torch.ones(3))


def test_light_falls_off_exponentially_in_uniform_fog():
    class Fog:
        box, background, resolution = BOX, torch.zeros(3), 0.01

        def density(self, points):
            return torch.full(points.shape[:-1], 0.7)

        def radiance(self, points, directions):
            return torch.ones_like(points)

        def samples(self, origins, directions):
            return uniform_samples(BOX, origins, directions, 0.01)

    rendering = render_rays(Fog(), torch.tensor([[-1.0, 0.0, 0.0]]), torch.tensor([[1.0, 0.0, 0.0]]))
    assert abs(rendering.opacity.item() - (1 - math.exp(-0.7 * 2))) < 1e-4


def test_a_picture_has_the_cameras_size_also_when_it_is_not_square():
    pose = look_at(torch.tensor([0.9, 0.0, 0.1]), torch.zeros(3))
    rendering = render_image(ball(), Camera.from_fov(40, 24, 70), pose)
    assert rendering.color.shape == (24, 40, 3)
    assert rendering.opacity[12, 20] > 0.99 > rendering.opacity[0, 0]


def test_colours_have_finite_first_and_second_derivatives_in_the_origin():
    direction = torch.tensor([[1.0, 0.0, 0.0]], dtype=torch.float64)

    def red(origin: torch.Tensor) -> torch.Tensor:
        return render_rays(ball(), origin[None], direction, samples).color[0, 0]

    origin = torch.tensor([-0.9, 0.05, 0.02], dtype=torch.float64)
    samples = uniform_samples(BOX, origin[None].float(), direction.float(), 0.01)
    gradient = torch.autograd.functional.jacobian(red, origin)
    hessian = torch.autograd.functional.hessian(red, origin)
    step = 1e-5
    for axis in range(3):
        offset = torch.zeros(3, dtype=torch.float64)
        offset[axis] = step
        assert abs((red(origin + offset) - red(origin - offset)) / (2 * step) - gradient[axis]) < 1e-6
    assert hessian.isfinite().all() and hessian.norm() > 0
