"""J in one compiled call against the same term by term, and steps of BFGS against those in Python."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import torch

from nerfnav.field.models.voxel import VoxelField
from nerfnav.geometry.grid import node_positions
from nerfnav.planner import terms
from nerfnav.planner.kernels.bfgs import inverse_of_absolute, inverse_of_shifted
from nerfnav.planner.objective.objective import Objective
from nerfnav.planner.risk.costs import CostWeights
from nerfnav.planner.solvers import bfgs
from nerfnav.planner.terms.term import CostTerm, TermContext
from nerfnav.planner.trajectory import Route
from nerfnav.robots.quadrotor import Quadrotor
from tests.planner.places import BOX, ROBOT
from tests.planner.test_objective import DT, GOAL, START, STEPS, guess

ROUTE = Route(START, GOAL, STEPS, DT)


def room() -> VoxelField:
    """A ball of fog in the middle of an empty box."""
    shape = (41, 41, 21)
    nodes = node_positions(BOX, shape)
    away = (nodes - torch.tensor([0.0, 0.0, 0.4])).norm(dim=-1)
    raw = torch.where(away < 0.45, -20 * (away - 0.2) - 4, torch.tensor(-20.0))
    return VoxelField(BOX, torch.cat([raw[..., None], torch.full((*shape, 3), 0.5)], -1), torch.ones(3))


def objective(weights: CostWeights | None = None) -> Objective:
    return Objective(TermContext(room(), ROBOT, weights or CostWeights()), ROUTE, terms.list_terms())


def term_by_term(weights: CostWeights | None = None) -> Objective:
    """The same with a term of one's own that is always 0, which no kernel knows."""
    nothing = CostTerm("nothing", lambda context, motion: 0 * motion.actions.sum((-2, -1)))
    context = TermContext(room(), ROBOT, weights or CostWeights())
    return Objective(context, ROUTE, (*terms.list_terms(), nothing))


@pytest.mark.parametrize("spread", [0.0, 0.05, 1.0])  # the last one leaves the box and runs out of thrust
@pytest.mark.parametrize("weights", [CostWeights(), CostWeights(collision=0.3, control=1.0, samples_per_step=1)])
def test_one_call_gives_the_terms_and_the_gradient_that_the_terms_give_one_by_one(spread: float, weights: CostWeights):
    fused, plain = objective(weights), term_by_term(weights)
    assert fused.fused is not None and plain.fused is None
    found, expected = fused(guess(spread)), plain(guess(spread))
    assert found.cost.collision == pytest.approx(expected.cost.collision, rel=1e-9) and found.cost.collision > 0
    assert found.cost.control == pytest.approx(expected.cost.control, rel=1e-9)
    assert found.cost.limits == pytest.approx(expected.cost.limits, rel=1e-9, abs=1e-12)
    np.testing.assert_allclose(
        found.gradient, expected.gradient, rtol=1e-7, atol=1e-9 * np.abs(expected.gradient).max()
    )


def test_curvature_without_collision_is_the_same_both_ways():
    scales = ROBOT.free_scales(torch.from_numpy(guess())).numpy()
    found, expected = (one.effort_curvature(guess(), 1e-4 * scales) for one in (objective(), term_by_term()))
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-6 * np.abs(expected).max())


def test_one_call_gives_the_terms_of_a_motion_that_is_there():
    fused = objective().fused
    assert fused is not None
    expected, flat = fused(guess()).cost, ROBOT.flat_map(START, GOAL, STEPS, DT)
    flat.forward(guess())
    found = fused.of_motion(flat.motion())
    assert found.collision == pytest.approx(expected.collision, rel=1e-4) and found.collision > 0
    assert found.total == pytest.approx(expected.total, rel=1e-3)


def test_both_ways_search_alike():
    scales, config = ROBOT.free_scales(torch.from_numpy(guess())).numpy(), bfgs.NewtonConfig(iterations=12)
    found, expected = (
        [found.point.cost.total for found in bfgs.minimise(one, one(guess()), scales, config)]
        for one in (objective(), term_by_term())
    )
    np.testing.assert_allclose(found, expected, rtol=1e-5)
    assert len(found) > 5 and found[-1] < 0.9 * found[0]


@pytest.mark.parametrize("spread", [0.0, 0.05])
def test_both_ways_refuse_the_same_steps_far_from_what_the_robot_can_do(spread: float) -> None:
    """There effort alone decides how much shorter the next try is, and the kernel does not ask the field."""
    start, scales = guess(spread), ROBOT.free_scales(torch.from_numpy(guess())).numpy()
    fused, plain, config = objective(), term_by_term(), bfgs.NewtonConfig(iterations=12)
    inverse = bfgs.preconditioner(plain.effort_curvature, start, scales, config.prior)
    found, expected = (
        [found.point for found in bfgs.minimise(search, search(start), scales, config, inverse)]
        for search in (fused, plain)
    )
    refused = 0
    for before, after in pairwise(expected):
        for farther in (10, 100):  # tries that the least factor may have led on from
            moved = farther * (after.free - before.free)
            slope, tried = float(moved @ before.gradient), plain(before.free + moved).cost
            refused += -0.5 * slope / (tried.control + tried.limits - before.cost.total - slope) <= 0.1
    assert refused > 5
    totals = [[step.cost.total for step in steps] for steps in (found, expected)]
    np.testing.assert_allclose(*totals, rtol=1e-8)
    for one, other in zip(found, expected, strict=True):
        np.testing.assert_allclose(one.gradient, other.gradient, atol=1e-6 * np.abs(other.gradient).max())


def test_what_kernels_do_not_know_is_evaluated_term_by_term():
    class Careful(Quadrotor):
        """Flies as its parent does, with a penalty of its own."""

        def limits(self, motion):
            return 2 * super().limits(motion)

    context = TermContext(room(), ROBOT, CostWeights())
    assert Objective(context, ROUTE, terms.list_terms()).fused is not None
    assert Objective(replace(context, robot=Careful()), ROUTE, terms.list_terms()).fused is None
    assert Objective(context, ROUTE, terms.list_terms()[:-1]).fused is None


@pytest.mark.parametrize("count", [1, 5, 40])
def test_the_inverse_of_the_absolute_value_is_that_by_eigenvectors(count: int):
    draws = np.random.default_rng(count).standard_normal((count, count))
    matrix = (draws + draws.T) * np.logspace(0, 3, count)[:, None] * np.logspace(0, 3, count)
    values, vectors = np.linalg.eigh(matrix)
    expected = vectors / (np.abs(values) + 1.0) @ vectors.T
    np.testing.assert_allclose(inverse_of_absolute(matrix, 1.0), expected, atol=1e-8 * np.abs(expected).max())
    np.testing.assert_allclose(inverse_of_absolute(np.zeros((count, count)), 2.0), 0.5 * np.eye(count))


@pytest.mark.parametrize("count", [12, 150])
def test_a_curvature_with_a_strongly_negative_eigenvalue_is_inverted_by_its_absolute_value(count: int):
    draws, scales = np.random.default_rng(0).standard_normal((count, count)), np.linspace(0.5, 2.0, count)
    vectors, values = np.linalg.qr(draws)[0], np.linspace(-100.0, 300.0, count)
    curvature = vectors * values @ vectors.T / np.outer(scales, scales)
    inverse = bfgs.preconditioner(lambda free, steps: curvature, np.zeros(count), scales, 1.0)
    absolute = vectors * (np.abs(values) + 1.0) @ vectors.T / np.outer(scales, scales)
    np.testing.assert_allclose(inverse @ absolute, np.eye(count), atol=1e-9)


@pytest.mark.parametrize("count", [12, 200])
def test_a_curvature_without_strongly_negative_eigenvalues_is_shifted_and_inverted(count: int):
    vectors = np.linalg.qr(np.random.default_rng(0).standard_normal((count, count)))[0]
    matrix, scales = vectors * np.linspace(-0.4, 300.0, count) @ vectors.T, np.linspace(0.5, 2.0, count)
    curvature = matrix / np.outer(scales, scales)
    inverse = bfgs.preconditioner(lambda free, steps: curvature, np.zeros(count), scales, 1.0)
    wanted = np.linalg.inv(matrix + np.eye(count)) * np.outer(scales, scales)
    np.testing.assert_allclose(inverse, wanted, rtol=1e-8, atol=1e-10)


def test_a_matrix_without_strongly_negative_eigenvalues_is_shifted_and_inverted():
    draws, inverse = np.random.default_rng(0).standard_normal((12, 12)), np.empty((12, 12))
    vectors = np.linalg.qr(draws)[0]
    matrix = vectors * np.linspace(-0.4, 300.0, 12) @ vectors.T
    assert inverse_of_shifted(matrix, 1.0, inverse)
    np.testing.assert_allclose(inverse, np.linalg.inv(matrix + np.eye(12)), rtol=1e-8, atol=1e-10)
    assert not inverse_of_shifted(matrix, 0.7, inverse)  # below half of the prior: its absolute value is wanted
