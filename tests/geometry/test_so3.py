"""Rotations: against matrix exponentials, finite differences and themselves."""

import json
import math
import os
from pathlib import Path

import pytest
import torch
from scipy.linalg import expm
from torch import Tensor

from nerfnav.geometry import so3

ANGLES = [0.0, 1e-12, 1e-8, 1e-5, 1e-3, 0.03, math.sqrt(1e-3), 0.032, 0.1, 1.0, 2.0, 3.0, 3.14]
"""Both sides of where the series take over, and near pi."""
BATCHES = [(), (1,), (5,), (2, 3)]


def random_vectors(*batch: int, seed: int = 0, scale: float = 1.0) -> Tensor:
    generator = torch.Generator().manual_seed(seed)
    return scale * torch.randn(*batch, 3, generator=generator, dtype=torch.float64)


def vector_of(angle: float) -> Tensor:
    axis = torch.tensor([0.6, -0.48, 0.64], dtype=torch.float64)
    return angle * axis


@pytest.mark.parametrize("angle", ANGLES)
def test_exp_is_the_matrix_exponential(angle: float):
    theta = vector_of(angle)
    exact = torch.from_numpy(expm(so3.hat(theta).numpy()))  # torch's own is only good to 1e-11
    torch.testing.assert_close(so3.exp(theta), exact, rtol=0, atol=1e-14)


@pytest.mark.parametrize("angle", ANGLES)
def test_log_undoes_exp_up_to_pi(angle: float):
    torch.testing.assert_close(so3.log(so3.exp(vector_of(angle))), vector_of(angle), rtol=1e-9, atol=1e-14)


@pytest.mark.parametrize("angle", [*ANGLES, math.pi])
def test_compiled_twins_answer_as_what_can_be_derived(angle: float):
    theta = torch.stack([vector_of(angle), -vector_of(angle), random_vectors()]).requires_grad_()
    rotation = so3.exp(theta)
    torch.testing.assert_close(so3.exp(theta.detach()), rotation.detach(), rtol=0, atol=1e-14)
    torch.testing.assert_close(so3.log(rotation.detach()), so3.log(rotation).detach(), rtol=1e-9, atol=1e-14)
    assert so3.log(so3.exp(theta)).requires_grad and not so3.exp(theta.detach()).requires_grad
    with torch.no_grad():
        assert not so3.exp(theta).requires_grad


def test_compiled_twins_keep_what_is_not_finite_visible():
    theta = torch.tensor([[math.nan, 0.0, 0.0], [0.1, 0.2, 0.3]])
    rotation = so3.exp(theta)
    assert rotation[0].isnan().any() and rotation[1].isfinite().all()
    assert so3.log(rotation)[0].isnan().any()


@pytest.mark.parametrize("axis", [(1, 0, 0), (0, 1, 0), (0, 0, 1), (-1, 0, 0), (0.6, 0, -0.8)])
def test_log_of_a_half_turn_is_a_half_turn_about_the_axis(axis: tuple[float, float, float]):
    direction = torch.tensor(axis, dtype=torch.float64)
    theta = so3.log(so3.exp(math.pi * direction))
    assert theta.norm().item() == pytest.approx(math.pi)
    assert abs(theta @ direction).item() == pytest.approx(math.pi)


@pytest.mark.parametrize("batch", BATCHES)
def test_every_function_takes_any_batch_shape(batch: tuple[int, ...]):
    theta = random_vectors(*batch)
    rotation = so3.exp(theta)
    assert rotation.shape == (*batch, 3, 3)
    axis = rotation[..., 0]
    torch.testing.assert_close((so3.hat(theta) @ axis[..., None])[..., 0], torch.linalg.cross(theta, axis))
    torch.testing.assert_close(so3.local(rotation, so3.retract(rotation, 0.5 * theta)), 0.5 * theta)
    torch.testing.assert_close(so3.matrix_from_quaternion(so3.quaternion_from_matrix(rotation)), rotation)
    assert so3.right_jacobian(theta).shape == (*batch, 3, 3)
    assert so3.project(rotation).shape == (*batch, 3, 3)
    assert so3.yaw_of(rotation).shape == batch


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_the_precision_stays_as_it_is(dtype: torch.dtype):
    theta = random_vectors(4).to(dtype)
    assert so3.exp(theta).dtype == so3.log(so3.exp(theta)).dtype == dtype
    assert so3.right_jacobian(theta).dtype == so3.quaternion_from_matrix(so3.exp(theta)).dtype == dtype


def test_hat_is_the_cross_product():
    left, right = random_vectors(2)
    torch.testing.assert_close(so3.hat(left) @ right, torch.linalg.cross(left, right))


@pytest.mark.parametrize("angle", [0.0, 1e-5, 0.02, 0.5, 2.5])
def test_first_and_second_derivatives_agree_with_finite_differences(angle: float):
    theta = vector_of(angle).requires_grad_()
    assert torch.autograd.gradcheck(so3.exp, (theta,))
    assert torch.autograd.gradgradcheck(so3.exp, (theta,))

    def there_and_back(vector: Tensor) -> Tensor:
        return so3.log(so3.exp(vector) @ so3.exp(torch.tensor([0.1, 0.2, -0.1], dtype=torch.float64)))

    assert torch.autograd.gradcheck(there_and_back, (theta,))
    assert torch.autograd.gradgradcheck(there_and_back, (theta,))


def test_the_hessian_at_the_origin_of_the_tangent_is_exact():
    # trace(A Exp(theta)) has the Hessian (A + A')/2 - trace(A) I there
    matrix = random_vectors(3).reshape(3, 3)
    hessian = torch.autograd.functional.hessian(
        lambda theta: (matrix @ so3.exp(theta)).diagonal().sum(), torch.zeros(3, dtype=torch.float64)
    )
    expected = 0.5 * (matrix + matrix.T) - matrix.trace() * torch.eye(3, dtype=torch.float64)
    torch.testing.assert_close(hessian, expected)


@pytest.mark.parametrize("angle", [0.0, 1e-4, 0.03, 1.0, 3.0])
def test_the_right_jacobian_is_the_derivative_of_exp(angle: float):
    theta = vector_of(angle)
    rotation = so3.exp(theta)
    derivative = torch.autograd.functional.jacobian(lambda d: so3.log(rotation.T @ so3.exp(theta + d)),
                                                    torch.zeros(3, dtype=torch.float64))  # fmt: skip
    torch.testing.assert_close(so3.right_jacobian(theta), derivative, rtol=0, atol=1e-9)


def test_project_takes_noise_out_of_a_rotation_and_reflections_too():
    rotation = so3.exp(random_vectors(6))
    noisy = rotation + 1e-3 * random_vectors(6, 3, seed=1)
    cleaned = so3.project(noisy)
    torch.testing.assert_close(cleaned @ cleaned.mT, torch.eye(3, dtype=torch.float64).expand(6, 3, 3))
    assert (cleaned - rotation).abs().max() < 5e-3
    flipped = so3.project(rotation * torch.tensor([1.0, 1.0, -1.0], dtype=torch.float64))
    torch.testing.assert_close(torch.det(flipped), torch.ones(6, dtype=torch.float64))


def test_from_yaw_turns_to_the_left():
    turned = so3.from_yaw(torch.tensor(math.pi / 2)) @ torch.tensor([1.0, 0.0, 0.0])
    torch.testing.assert_close(turned, torch.tensor([0.0, 1.0, 0.0]), rtol=0, atol=1e-6)
    yaws = torch.tensor([-3.0, -1.0, 0.0, 2.0])
    torch.testing.assert_close(so3.yaw_of(so3.from_yaw(yaws)), yaws)


@pytest.mark.parametrize("angle", ANGLES)
def test_quaternions_have_unit_length_and_a_positive_real_part(angle: float):
    quaternion = so3.quaternion_from_matrix(so3.exp(vector_of(angle)))
    assert quaternion.norm().item() == pytest.approx(1)
    assert quaternion[0] >= 0
    assert 2 * math.acos(min(1.0, quaternion[0].item())) == pytest.approx(angle, abs=1e-7)


def test_a_quaternions_length_and_sign_do_not_matter():
    quaternion = torch.tensor([0.5, -0.1, 0.7, 0.2], dtype=torch.float64)
    torch.testing.assert_close(so3.matrix_from_quaternion(quaternion), so3.matrix_from_quaternion(-3 * quaternion))


@pytest.mark.skipif("NERFNAV_TEST_DATA" not in os.environ, reason="needs recorded twists")
def test_recorded_twists_have_the_same_rotations():
    folder = Path(os.environ["NERFNAV_TEST_DATA"])
    items = json.loads((folder / "oracles" / "se3_vectors.json").read_text())["items"]
    theta = torch.tensor([item["xi"][3:] for item in items], dtype=torch.float64)
    rotation = torch.tensor([item["T_expm"] for item in items], dtype=torch.float64)[:, :3, :3]
    torch.testing.assert_close(so3.exp(theta), rotation, rtol=0, atol=1e-11)
    angle = theta.norm(dim=-1)
    assert angle.max() < math.pi
    # near pi the logarithm magnifies the rounding of the recorded matrices by 1 / (pi - angle) at most
    assert ((so3.log(rotation) - theta).norm(dim=-1) <= 1e-9 / (math.pi - angle).clamp_max(1)).all()
