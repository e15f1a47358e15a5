"""The pose filter against iNeRF on disturbed flights."""

import math

import pytest
import torch

from nerfnav.core.steps import run_steps
from nerfnav.estimator.core.belief import Belief
from nerfnav.experiments.estimation import METHODS, draw_figure, run, summarize
from nerfnav.experiments.estimation import errors_of as judge
from nerfnav.experiments.study import Row, Study
from nerfnav.robots import StateNoise
from nerfnav.robots.state import RigidState
from tests.experiments.places import PAST, column

HERE = RigidState.at_rest((0.1, 0.2, 0.3), 0.4)


def row(method: str, step: int, error: float, **other: object) -> Row:
    lengths = {"position_m": error, "rotation_rad": error / 2, "velocity_mps": error, "rate_radps": error}
    honest = {"nees_pose": 6.0, "nees": 12.0, "inside_95": True}
    return {"seed": 0, "task": "a", "method": method, "step": step} | lengths | honest | other


def test_a_belief_is_judged_by_its_own_covariance() -> None:
    belief = Belief(HERE, StateNoise.isotropic(0.02**2).covariance())
    error = torch.zeros(12)
    error[0], error[6], error[3] = 0.06, 0.02, 0.04
    judged = judge(belief, HERE.retract(error))
    assert judged["position_m"] == pytest.approx(0.06, rel=1e-4) and judged["velocity_mps"] == pytest.approx(0.04)
    assert judged["nees_pose"] == pytest.approx(9 + 1, rel=1e-2) and judged["nees"] == pytest.approx(14, rel=1e-2)
    assert not judged["inside_95"]  # 3 standard deviations of one number: 9 is more than 7.8


def test_errors_are_summed_over_all_steps_and_at_the_end() -> None:
    rows = [row("nerfnav", step, 0.03 if step == 20 else 0.01) for step in range(1, 21)]
    rows += [row("inerf", step, 0.3) for step in range(1, 21)]
    summary = summarize(rows)
    own = summary["methods"]["nerfnav"]
    assert own["position_rmse_m"] == pytest.approx(math.sqrt((19 * 0.01**2 + 0.03**2) / 20))
    assert own["final_position_rmse_m"] == pytest.approx(0.03) and own["diverged"] == 0 and own["trials"] == 1
    assert summary["methods"]["inerf"]["diverged"] == 1
    assert summary["ratios"]["final_position_rmse_m"] == pytest.approx(0.1)
    assert (summary["nees_pose_mean"], summary["nees_mean"], summary["inside_95"]) == (6.0, 12.0, 1.0)


def test_the_figure_has_mean_and_band_of_both_methods_for_each_error() -> None:
    axes = draw_figure([row(method, step, 0.01 * step) for method in METHODS for step in range(1, 21)]).axes
    assert len(axes) == 4
    for ax in axes:
        assert [line.get_label() for line in ax.lines] == list(METHODS) and len(ax.collections) == 2
        assert len(ax.lines[0].get_xdata()) == 20


@pytest.mark.slow
def test_both_methods_follow_every_flight() -> None:
    results = run_steps(run(Study(column, (PAST,), trials=1)))
    assert [(entry["method"], entry["step"]) for entry in results.rows] == [
        (method, step) for method in METHODS for step in range(1, 21)
    ]
    assert results.summary["methods"]["nerfnav"]["trials"] == 1
    assert list(results.figures) == ["estimation"]
