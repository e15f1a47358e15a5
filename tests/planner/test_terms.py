"""Cost terms from outside the package: counted by every planner and report, and their derivatives right."""

from collections.abc import Callable, Iterator

import numpy as np
import pytest
import torch
from torch import Tensor

from nerfnav import robots
from nerfnav.core.errors import InvalidInputError, NameTakenError, UnknownNameError
from nerfnav.core.steps import run_steps
from nerfnav.planner import planners, terms
from nerfnav.planner.objective.objective import Objective
from nerfnav.planner.objective.problem import PlanProblem
from nerfnav.planner.risk.costs import CostWeights
from nerfnav.planner.solvers.adam import PlanConfig
from nerfnav.planner.space.astar import waypoints_along
from nerfnav.planner.steps import PlanStep
from nerfnav.planner.terms.term import Adjoint, CostTerm, Kernel, TermContext
from nerfnav.planner.trajectory import Route
from nerfnav.robots.flat_map import FlatMap
from nerfnav.robots.state import Motion, RigidState
from tests.planner.places import ROBOT, Fog, ball
from tests.robots.motions import SMALL

START, GOAL = RigidState.at_rest((-0.7, 0.02, 0.4), 0.2), RigidState.at_rest((0.7, 0.0, 0.4), 0.3)
EMPTY = Fog(rho=0.0)
CONTEXT = TermContext(ball(), ROBOT, CostWeights())
SETTINGS = {"fast": None, "paper": PlanConfig(iterations=200), "minsnap": None}


def height(_: TermContext, motion: Motion) -> Tensor:
    """Squared distances from 80 cm [m^2]."""
    return (motion.states.position[..., 2] - 0.8).square().sum(-1)


def everything(_: TermContext, motion: Motion) -> Tensor:
    """Something of each part of the motion."""
    states = motion.states
    parts = (states.position[..., 0] ** 3, states.velocity[..., 1] ** 2, states.rotation[..., 0, 1],
             states.body_rate.square().sum(-1), states.rotation[..., 2, 2] ** 2)  # fmt: skip
    return torch.stack([part.sum(-1) for part in parts]).sum(0) + 0.1 * motion.actions.square().sum((-2, -1))


@pytest.fixture
def known() -> Iterator[Callable[[CostTerm], None]]:
    """Registers terms for one test."""
    names: list[str] = []

    def register(term: CostTerm) -> None:
        terms.register(term)
        names.append(term.name)

    yield register
    for name in names:
        terms.unregister(name)


def planned(name: str) -> PlanStep:
    planner = planners.load(name).planner(EMPTY, ROBOT, SETTINGS[name])
    return run_steps(planner.plan(Route(START, GOAL)))


@pytest.mark.parametrize("name", ["fast", pytest.param("paper", marks=pytest.mark.slow)])
def test_a_registered_term_changes_what_is_chosen_the_more_it_weighs(
    name: str, known: Callable[[CostTerm], None]
) -> None:
    missed = [height(CONTEXT, planned(name).motion).item()]
    for weight in (0.1, 5.0):
        known(CostTerm(f"height {weight:g}", height, weight))
        missed.append(height(CONTEXT, planned(name).motion).item())
    assert missed[0] > 1.02 * missed[1] > 1.02**2 * missed[2]


@pytest.mark.slow
@pytest.mark.parametrize("name", SETTINGS)
def test_every_planner_reports_a_registered_term_and_its_time(
    name: str, known: Callable[[CostTerm], None]
) -> None:
    known(CostTerm("height", height, 3.0))
    step = planned(name)
    (added,) = step.cost.added
    assert added.name == "height" and 0 < added.ms < 1000
    assert added.value == pytest.approx(3 * height(CONTEXT, step.motion).item(), rel=1e-4)
    assert step.cost.total == pytest.approx(step.cost.collision + step.cost.control + step.cost.limits + added.value)


def test_the_reported_time_is_the_time_that_was_taken(known: Callable[[CostTerm], None]) -> None:
    def slow(context: TermContext, motion: Motion) -> Tensor:
        begun = torch.randn(300, 300)
        for _ in range(20):
            begun = begun @ begun / 300
        return 0 * begun.sum() + height(context, motion)

    quick, late = CostTerm("quick", height), CostTerm("late", slow)
    objective = Objective(CONTEXT, Route(START, GOAL), (*terms.list_terms(), quick, late))
    free = straight(robots.load("quadrotor"))
    for _ in range(20):
        added = objective(free).cost.added
    assert [term.name for term in added] == ["quick", "late"]
    assert added[1].ms > 2 * added[0].ms


def test_a_term_of_one_problem_is_not_counted_in_another() -> None:
    mine = PlanProblem(EMPTY, ROBOT, START, GOAL, terms=(*terms.list_terms(), CostTerm("height", height)))
    assert "height" in {term.name for term in mine.terms}
    assert "height" not in {term.name for term in PlanProblem(EMPTY, ROBOT, START, GOAL).terms}


def straight(robot: robots.Robot) -> np.ndarray:
    """Free numbers near the straight line."""
    waypoints = waypoints_along(torch.stack([START.position, GOAL.position]), START, GOAL, 20)
    free = robot.encode(waypoints, START, GOAL, 0.1).double().numpy()
    return free + 0.01 * np.random.default_rng(0).standard_normal(free.shape)


@pytest.mark.parametrize("name", SMALL)
@pytest.mark.parametrize("value", [height, everything])
def test_the_derivative_of_a_term_without_kernel_is_that_of_finite_differences(
    name: str, value: Callable[[TermContext, Motion], Tensor]
) -> None:
    robot = robots.load(name)
    context = TermContext(EMPTY, robot, CostWeights())
    j, free, step = Objective(context, Route(START, GOAL), (CostTerm("mine", value, 2.0),)), straight(robot), 1e-6
    gradient = j(free).gradient
    generator = np.random.default_rng(1)
    for _ in range(8):
        direction = generator.standard_normal(free.shape)
        slope = (j(free + step * direction).cost.total - j(free - step * direction).cost.total) / (2 * step)
        assert slope == pytest.approx(gradient @ direction, rel=1e-4, abs=1e-4)


def test_a_term_with_a_kernel_of_its_own_is_evaluated_by_it() -> None:
    def kernel(_: TermContext, weight: float) -> Kernel:
        def weighed(flat: FlatMap, by: Adjoint) -> float:
            by.position[:, 2] += 2 * weight * (flat.position[:, 2] - 0.8)
            return weight * float(np.square(flat.position[:, 2] - 0.8).sum())

        return weighed

    free = straight(ROBOT)
    compiled, reference = (
        Objective(CONTEXT, Route(START, GOAL), (CostTerm("height", height, 4.0, twin),))(free)
        for twin in (kernel, None)
    )
    assert compiled.cost.total == pytest.approx(reference.cost.total)
    np.testing.assert_allclose(compiled.gradient, reference.gradient, atol=1e-9)


@pytest.mark.parametrize(
    ("value", "wrong"),
    [(lambda _, motion: motion.states.position[..., 2], r"shape \(21,\)"), (lambda *_: 1.0, "float")],
)
def test_a_term_that_gives_no_number_for_a_motion_is_refused_by_name(
    value: Callable[[TermContext, Motion], Tensor], wrong: str
) -> None:
    objective = Objective(CONTEXT, Route(START, GOAL), (CostTerm("mine", value),))
    with pytest.raises(InvalidInputError, match=f"cost term 'mine'.*{wrong}"):
        objective(straight(ROBOT))


def test_a_term_that_is_constant_has_no_derivative() -> None:
    found = Objective(CONTEXT, Route(START, GOAL), (CostTerm("mine", lambda *_: torch.tensor(2.0), 3.0),))
    evaluation = found(straight(ROBOT))
    assert evaluation.cost.total == 6.0 and not evaluation.gradient.any()


def test_a_taken_name_is_refused_and_an_unknown_one_too() -> None:
    with pytest.raises(NameTakenError, match="cost term named 'collision' already"):
        terms.register(CostTerm("collision", height))
    with pytest.raises(UnknownNameError, match="known are: collision"):
        terms.unregister("nothing")
