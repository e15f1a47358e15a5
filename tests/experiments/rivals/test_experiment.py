"""The comparison with other people's planners, in a place so simple that nerfnav must manage."""

import sys
from dataclasses import replace
from types import ModuleType, SimpleNamespace

import numpy as np
import pytest
import torch

from nerfnav.core.steps import run_steps
from nerfnav.experiments.closed_loop_flight import FlightTrial, make_problem
from nerfnav.experiments.rivals import experiment, flask_planner, rival
from nerfnav.experiments.rivals.experiment import RIVALS, Pair, at_rate, compare, judge_answer, pairs_of, run, summarize
from nerfnav.experiments.rivals.rival import POINTS_M, Answer, make_search_mesh, sample_surface
from nerfnav.experiments.study import Results, Study
from nerfnav.planner import PlanProblem
from nerfnav.robots import Motion
from nerfnav.world import Task
from tests.experiments.places import TASKS, column

ALWAYS = ("nerfnav", "minsnap", "rrt")
OTHERS = ("drone-planning", "vamp-planner")


def problem_of(task: Task) -> PlanProblem:
    return make_problem(column(), task, FlightTrial(task, 0))


@pytest.fixture(scope="module")
def results() -> Results:
    """Two pairs, as on a machine where only the dependencies are installed."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(rival, "installed_version", lambda name: None)
        return run_steps(run(Study(column, TASKS, trials=2)))


def test_own_planners_and_baselines_plan_a_task_and_random_ends(results: Results) -> None:
    assert [(row["ends"], row["planner"]) for row in results.rows] == [
        (ends, name) for ends in ("tasks", "random") for name in ALWAYS
    ]
    for row in results.rows:
        assert row["place"] == "column" and row["solved"] and row["plan_ms"] > 0 and row["J"] > 0 and row["J_own"] > 0
    assert results.summary["methods"]["nerfnav"]["clean"] == 2 and results.summary["solved_by_all"] == 2
    assert results.summary["places"].keys() == {"column"} and results.summary["ends"].keys() == {"tasks", "random"}


def test_planners_that_are_not_installed_are_rows_that_say_how_to(results: Results) -> None:
    for name in OTHERS:
        assert results.summary["methods"][name].keys() == {"skipped"}
        assert f"pip install {name}" in results.summary["methods"][name]["skipped"]


def test_a_planner_that_is_installed_and_broken_is_a_row_with_the_reason(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(rival, "installed_version", lambda name: "1.0")
    for name, module in zip(OTHERS, ("drone_planning.planning", "vamp"), strict=True):
        monkeypatch.setitem(sys.modules, module, None)  # makes its import fail
        reason = RIVALS[name].missing()
        assert reason is not None and "cannot be imported" in reason and module in reason


def test_each_planner_says_its_version_options_and_what_it_does_not_do(results: Results) -> None:
    for name in ALWAYS:
        assert all(results.summary["methods"][name][key] for key in ("version", "options", "does_not"))


def test_the_figure_has_a_bar_for_every_planner_that_ran(results: Results) -> None:
    clean, times, costs = results.figures["rivals"]().axes
    assert len(clean.patches) == len(costs.patches) == len(times.lines) == len(ALWAYS)


def test_tasks_and_random_ends_take_turns_until_the_tasks_end_and_other_seeds_are_other_ends() -> None:
    driving = replace(TASKS[0], robot="couch")
    pairs = pairs_of(Study(column, (driving, *TASKS), trials=6, seed=40), ALWAYS)
    assert [pair.ends.task for pair in pairs] == [TASKS[0], None, TASKS[1], None, None, None]
    assert [pair.seed for pair in pairs] == list(range(40, 46))
    starts = {compare(column(), Pair(FlightTrial(None, seed), ("minsnap",)))[0]["length_m"] for seed in (1, 1, 2)}
    assert len(starts) == 2


def test_every_bundled_task_is_planned_by_default() -> None:
    many = tuple(replace(TASKS[0], name=str(index)) for index in range(20))
    assert {pair.ends.task for pair in pairs_of(Study(column, many), ALWAYS)} == {*many, None}


def test_a_straight_path_through_the_column_is_solved_and_not_clean() -> None:
    task = TASKS[0]
    row = judge_answer(column(), problem_of(task), Answer(1.0, np.array([task.start, task.goal])))
    assert row["solved"] and row["touched"] and not row["clean"] and row["J_own"] is None
    assert row["length_m"] == pytest.approx(1.4, abs=0.01)


def test_a_motion_that_stops_short_of_the_goal_is_not_clean() -> None:
    problem = problem_of(TASKS[1])
    whole = experiment.smooth(problem, torch.tensor([TASKS[1].start, TASKS[1].goal]))
    half = Motion(whole.states[:11], whole.actions[:10], whole.dt)
    answers = [Answer(1.0, motion.states.position.numpy(), motion) for motion in (whole, half)]
    arrived, short = (judge_answer(column(), problem, answer) for answer in answers)
    assert arrived["clean"] and not short["clean"] and not short["touched"]
    assert short["goal_missed_by_m"] > 0.1 > arrived["goal_missed_by_m"]


def test_an_end_that_no_planner_can_use_has_its_reason_and_the_others_go_on() -> None:
    inside = replace(TASKS[0], goal=(0.0, 0.0, 0.5))
    rows = compare(column(), Pair(FlightTrial(inside, 0), ("nerfnav", "minsnap")))
    for row in rows:
        assert not row["solved"] and not row["clean"] and row["reason"] and row["J"] is None


def test_states_are_judged_100_times_a_second_between_those_of_the_motion() -> None:
    problem = problem_of(TASKS[1])
    motion = experiment.smooth(problem, torch.tensor([TASKS[1].start, TASKS[1].goal]))
    states = at_rate(motion)
    assert len(states.position) == 100 * problem.steps * problem.dt + 1
    torch.testing.assert_close(states.position[::10], motion.states.position)
    torch.testing.assert_close(states.rotation[::10], motion.states.rotation, atol=1e-5, rtol=0)
    middle = 0.5 * (motion.states.position[3] + motion.states.position[4])
    torch.testing.assert_close(states.position[35], middle)


def test_the_cost_is_over_the_pairs_that_all_planners_solved() -> None:
    def row(planner: str, seed: int, cost: float | None) -> dict:
        known = {"place": "a", "ends": "tasks", "seed": seed, "planner": planner, "plan_ms": float(seed)}
        return known | {"solved": cost is not None, "clean": cost is not None, "J": cost, "J_own": None}

    rows = [row("nerfnav", 1, 2.0), row("nerfnav", 2, 100.0), row("rrt", 1, 4.0), row("rrt", 2, None)]
    missing = {name: "not here" for name in RIVALS if name not in ("nerfnav", "rrt")}
    summary = summarize(rows, missing)
    assert (summary["methods"]["nerfnav"]["J_median"], summary["methods"]["rrt"]["J_median"]) == (2.0, 4.0)
    assert (summary["methods"]["nerfnav"]["solved"], summary["methods"]["rrt"]["solved"]) == (2, 1)
    assert summary["solved_by_all"] == 1 and summary["methods"]["nerfnav"]["time_p50_ms"] == 1.5


def test_points_of_the_surface_lie_on_the_mesh_that_trees_grow_around_and_leave_no_gaps() -> None:
    mesh, points = make_search_mesh(column()), sample_surface(column())
    assert len(points) > len(mesh.vertices)
    column_side = points[(np.abs(points[:, 1]) < 0.15) & (points[:, 0] > 0) & (np.abs(points[:, 2] - 0.5) < 0.3)]
    assert np.ptp(column_side[:, 0]) < 0.01, "one flat side"
    gaps = np.linalg.norm(column_side[:, None] - column_side[None], axis=-1) + 1e3 * np.eye(len(column_side))
    assert gaps.min(1).max() <= POINTS_M


class Trajectory:
    """Straight line in 4 s."""

    duration = 4.0

    def __init__(self, start: np.ndarray, goal: np.ndarray) -> None:
        self.ends = start, goal

    def sample(self, times: np.ndarray) -> tuple[np.ndarray]:
        share = times[:, None] / self.duration
        return ((1 - share) * self.ends[0] + share * self.ends[1],)


def test_flask_plans_in_an_enlarged_world_and_is_stretched_to_the_duration(monkeypatch: pytest.MonkeyPatch) -> None:
    asked: dict = {}

    def create_planner(robot: str, config: SimpleNamespace, pointcloud: np.ndarray) -> SimpleNamespace:
        asked.update(robot=robot, limits=config.joint_limits, cloud=pointcloud)

        def plan(start: np.ndarray, goal: np.ndarray, config: SimpleNamespace) -> SimpleNamespace:
            asked.update(start=start, goal=goal, seed=config.seed)
            return SimpleNamespace(trajectory=Trajectory(start, goal), status=SimpleNamespace(value="success"))

        return SimpleNamespace(plan_kinodynamic=plan)

    planning, types = ModuleType("drone_planning.planning"), ModuleType("drone_planning.types")
    planning.create_planner = create_planner  # pyright: ignore[reportAttributeAccessIssue]
    types.PlannerConfig = types.KinodynamicConfig = SimpleNamespace  # pyright: ignore[reportAttributeAccessIssue]
    for module in (ModuleType("drone_planning"), planning, types):
        monkeypatch.setitem(sys.modules, module.__name__, module)
    problem = problem_of(TASKS[1])
    answer = RIVALS["drone-planning"].prepare(column())(problem, 7)
    scale = flask_planner.SCALE
    np.testing.assert_allclose(asked["start"][:2], scale * np.array(TASKS[1].start[:2]), atol=1e-5)
    assert asked["seed"] == 7 and asked["robot"] == "x500_base"
    np.testing.assert_allclose(asked["cloud"], scale * sample_surface(column()), atol=1e-5)
    lower, upper = asked["limits"]["base_x_joint"]
    assert (lower, upper) == pytest.approx((-scale + 0.354, scale - 0.354), abs=1e-4)
    assert answer.path is not None and answer.motion is not None
    np.testing.assert_allclose(answer.path[[0, -1]], [TASKS[1].start, TASKS[1].goal], atol=1e-5)
    assert len(answer.motion.actions) == problem.steps
    torch.testing.assert_close(answer.motion.states.position[-1], problem.goal.position)


@pytest.mark.parametrize("name", OTHERS)
def test_other_planners_where_installed_repeat_with_a_seed(name: str) -> None:
    if RIVALS[name].missing() is not None:
        pytest.skip(f"{name} is not installed")
    problem, plan = problem_of(TASKS[0]), RIVALS[name].prepare(column())
    one, same = plan(problem, 3), plan(problem, 3)
    assert one.path is not None and same.path is not None
    np.testing.assert_array_equal(one.path, same.path)
    np.testing.assert_allclose(one.path[[0, -1]], [TASKS[0].start, TASKS[0].goal], atol=1e-4)
