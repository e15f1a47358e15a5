"""The neural field: encodings, samples where they matter, derivatives, files, and that it learns."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from nerfnav.core.errors import FieldFileError, InvalidInputError
from nerfnav.core.steps import run_steps
from nerfnav.field.core.protocol import Field, density_and_gradient, uniform_samples
from nerfnav.field.models.mlp import Encoding, MlpConfig
from nerfnav.field.models.neural import NeuralField, blank_field
from nerfnav.field.render.jacobian import colors_and_jacobian
from nerfnav.field.render.volume_rendering import render_rays
from nerfnav.field.storage.checkpoint import load_field, save_field
from nerfnav.field.train.neural import NeuralTrainConfig, drawn_from, train_neural
from nerfnav.geometry import so3
from nerfnav.geometry.camera import Pose
from tests.collected_steps import collect
from tests.field.fields import BOX, photographs_of_ball, random_rays

TINY = MlpConfig(depth=3, width=24, skips=(2,), position=Encoding(3), direction=Encoding(2), view_widths=(12,))


def random_field(seed: int = 0, dtype: torch.dtype = torch.float32) -> NeuralField:
    """Soft blobs of random colours, turned and moved in its box."""
    generator = torch.Generator().manual_seed(seed)
    field = blank_field(BOX, torch.tensor([0.2, 0.5, 0.8]), TINY, generator)
    frame = Pose(so3.exp(torch.tensor([0.3, -0.2, 0.5])), torch.tensor([0.1, 0.0, 0.2]))
    with torch.no_grad():
        for network in (field.coarse, field.fine):
            network.requires_grad_(False).to(dtype).density.weight.mul_(8)
    field.coarse.load_state_dict(field.fine.state_dict())
    return replace(field, frame=frame.to(dtype), box=BOX.to(dtype), background=field.background.to(dtype))


def test_it_is_a_field() -> None:
    assert isinstance(random_field(), Field)


def test_the_paper_has_eight_layers_of_256_and_sees_the_point_again_in_the_sixth() -> None:
    shapes = [tuple(layer.weight.shape) for layer in blank_field(
        BOX, torch.ones(3), MlpConfig(), torch.Generator().manual_seed(0)
    ).fine.hidden]
    assert shapes == [(256, 63), *[(256, 256)] * 4, (256, 319), *[(256, 256)] * 2]


def test_the_encoding_is_the_vector_and_waves_of_it() -> None:
    encoding = Encoding(2)
    x, y, z = point = (0.3, -0.7, 1.1)
    waves = [f(k * value) for k in (1, 2) for f in (math.sin, math.cos) for value in point]
    torch.testing.assert_close(encoding(torch.tensor([point]))[0], torch.tensor([x, y, z, *waves]))
    assert encoding.width == 15 and Encoding(2, include_input=False).width == 12
    even = Encoding(3, include_input=False, octaves=False)(torch.tensor([1.0, 0, 0]))
    torch.testing.assert_close(even[6], torch.tensor(2.5).sin())  # 1, 2.5, 4


def test_density_is_that_of_the_network_per_metre_and_zero_outside() -> None:
    field = random_field()
    points = torch.rand(200, 3, generator=torch.Generator().manual_seed(1)) * 3 - 1.5
    local = torch.stack([field.frame.rotation.T @ (p - field.frame.position) for p in points]) / field.config.unit
    raw = field.fine.raw_density(field.fine.features(local))
    inside = BOX.contains(points)
    wanted = torch.where(inside, torch.nn.functional.softplus(raw - 1) / field.config.unit, torch.zeros(200))
    assert 0 < inside.sum() < 200
    torch.testing.assert_close(field.density(points), wanted, rtol=1e-4, atol=1e-5)


def test_samples_where_they_matter_give_the_picture_of_samples_everywhere() -> None:
    field, rays = random_field(), random_rays(200)
    everywhere = render_rays(field, *rays, uniform_samples(BOX, *rays, 0.5 * field.step))
    chosen = field.samples(*rays)
    difference = (render_rays(field, *rays).color - everywhere.color).abs()
    assert difference.mean() < 1e-3 and difference.max() < 0.03  # the last sample of a ray may end before the box
    assert chosen.mask.sum() < 0.9 * uniform_samples(BOX, *rays, field.step).mask.sum()


def test_its_own_renderer_is_the_reference() -> None:
    field, rays = random_field(), random_rays(100)
    own, reference = field.render_rays(*rays), render_rays(field, *rays)
    torch.testing.assert_close(own.color, reference.color)
    torch.testing.assert_close(own.depth, reference.depth)
    missing = (torch.tensor([[9.0, 9, 9]]), torch.tensor([[0.0, 0, 1]]))
    torch.testing.assert_close(field.render_rays(*missing).color[0], field.background)


def test_first_and_second_derivatives_agree_with_finite_differences() -> None:
    field = random_field(dtype=torch.float64)
    points = (torch.rand(6, 3, generator=torch.Generator().manual_seed(2)).double() - 0.5).requires_grad_()
    assert torch.autograd.gradcheck(field.density, points, eps=1e-6, atol=1e-4)
    assert torch.autograd.gradgradcheck(field.density, points, eps=1e-6, atol=1e-3)
    density, gradient = density_and_gradient(field, points.detach().numpy())
    np.testing.assert_allclose(density, field.density(points).detach().numpy())
    assert np.abs(gradient).max() > 0.1


def test_the_filter_gets_its_jacobian() -> None:
    field = random_field()
    origins, directions = torch.zeros(20, 3) + 0.05, random_rays(20)[1]
    color, jacobian = colors_and_jacobian(field, origins, directions)
    samples = field.samples(origins, directions)
    step = torch.tensor([1e-2, 0, 0])
    ahead = render_rays(field, origins + step, directions, samples).color
    behind = render_rays(field, origins - step, directions, samples).color
    torch.testing.assert_close(jacobian[..., 0], (ahead - behind) / 2e-2, rtol=0.05, atol=0.02)
    assert color.shape == (20, 3)


def test_a_stored_field_is_the_same_field(tmp_path: Path) -> None:
    field = replace(random_field(), info=replace(random_field().info, source="lego", psnr_db=21.0))
    assert save_field(field, tmp_path / "f.npz") == (tmp_path / "f.npz").stat().st_size
    loaded = load_field(tmp_path / "f.npz")
    assert isinstance(loaded, NeuralField) and loaded.info == field.info and loaded.config == field.config
    rays = random_rays(50)
    torch.testing.assert_close(loaded.render_rays(*rays).color, field.render_rays(*rays).color, rtol=0, atol=0)
    assert list(tmp_path.iterdir()) == [tmp_path / "f.npz"]


def test_a_torn_file_is_refused_and_a_failed_write_leaves_the_old_one(tmp_path: Path) -> None:
    file = tmp_path / "f.npz"
    save_field(random_field(), file)
    whole = file.read_bytes()
    file.write_bytes(whole[:-200])
    with pytest.raises(FieldFileError, match="not a whole nerfnav field"):
        load_field(file)
    with pytest.raises(FieldFileError, match="cannot be written"):
        save_field(random_field(), tmp_path / "no folder" / "f.npz")


def test_samples_are_drawn_where_the_weights_are() -> None:
    edges = torch.tensor([[0.0, 1.0, 3.0, 4.0]])
    weights = torch.tensor([[1.0, 0.0, 3.0]])
    shares = torch.linspace(0.001, 0.999, 4001)[None]
    drawn = drawn_from(edges, weights, shares)
    assert ((drawn < 1).float().mean(), (drawn > 3).float().mean()) == (
        pytest.approx(0.25, abs=0.01), pytest.approx(0.75, abs=0.01)
    )  # fmt: skip
    assert (drawn.diff() >= 0).all() and drawn.max() <= 4


@pytest.mark.slow
def test_a_tiny_network_learns_a_ball() -> None:
    generator = torch.Generator().manual_seed(0)
    network = MlpConfig(depth=3, width=40, skips=(), position=Encoding(5), direction=None, view_widths=())
    config = NeuralTrainConfig(
        network, iterations=220, rays=160, coarse_samples=20, fine_samples=16, rate=6e-3, report_every=20
    )
    blank = blank_field(BOX, torch.ones(3), network, generator)
    held_out = photographs_of_ball(3, size=24, turn=0.3)
    (*steps, last), field = collect(train_neural(photographs_of_ball(20, size=32), held_out, blank, config, generator))
    assert len(steps) == 10 and steps[-1].psnr_db > steps[0].psnr_db + 6
    assert field.info.iterations == 220
    assert last.psnr_db == field.info.psnr_db > 20
    assert field.info.noise_std == pytest.approx(10 ** (-last.psnr_db / 20), rel=0.3)
    assert field.density(torch.zeros(1, 3)) > 5 * field.density(torch.tensor([[0.8, 0.8, 0.4]]))


def test_training_stops_when_it_is_told_to_and_keeps_what_it_learned() -> None:
    generator = torch.Generator().manual_seed(0)
    blank = blank_field(BOX, torch.ones(3), TINY, generator)
    config = NeuralTrainConfig(TINY, iterations=1000, rays=8, coarse_samples=4, fine_samples=4, report_every=1)
    steps = train_neural(photographs_of_ball(2, size=8), photographs_of_ball(1, size=8), blank, config, generator)
    next(steps)
    assert steps.send(True).last
    assert run_steps(steps).info.iterations < 5
    with pytest.raises(InvalidInputError, match="no image"):
        nothing = photographs_of_ball(2, size=8).subset([])
        next(train_neural(nothing, nothing, blank, config, generator))
