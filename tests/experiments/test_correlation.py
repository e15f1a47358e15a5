"""Loss against overlap where both are known beforehand."""

import numpy as np
import pytest
import torch

from nerfnav.experiments.correlation import PlanTrial, draw_figure, observe_plan, overlap_along, summarize
from nerfnav.robots.state import Motion, RigidState
from nerfnav.world.task import Task
from tests.experiments.places import column


def test_the_overlap_of_a_straight_way_through_is_volume_times_way() -> None:
    positions = torch.tensor([[-0.6, 0.0, 0.5], [0.6, 0.0, 0.5]])
    still = torch.zeros(2, 3)
    states = RigidState(positions, still, torch.eye(3).expand(2, 3, 3), still)
    motion = Motion(states, torch.zeros(1, 4), 0.1)
    assert overlap_along(column(), motion) == pytest.approx(0.1 * 0.1 * 0.04 * 0.4, rel=0.02)


@pytest.mark.slow
def test_a_plan_that_begins_in_the_column_leaves_it() -> None:
    past = Task("Past", (-0.7, 0.18, 0.5), (0.7, 0.18, 0.5))
    rows = observe_plan(column(), PlanTrial(past, iterations=160, every=2))
    assert rows[0]["overlap_m4"] > 0 and rows[-1]["overlap_m4"] == 0
    assert rows[-1]["loss"] < 0.05 * rows[0]["loss"]
    summary = summarize(rows)
    assert summary["spearman_median"] > 0.9
    assert summary["final_overlaps"] == 0


def test_only_iterations_until_the_plan_is_free_are_correlated() -> None:
    overlap = [4.0, 3.0, 2.0, 1.0, 0.0, 0.0, 0.0, 0.0]
    loss = [9.0, 8.0, 7.0, 6.0, 1.0, 2.0, 3.0, 4.0]  # afterwards it rises, which says nothing of overlap
    rows = [
        {"task": "a", "iteration": k, "loss": a, "overlap_m4": b}
        for k, (a, b) in enumerate(zip(loss, overlap, strict=True))
    ]
    summary = summarize(rows)
    assert summary["spearman_median"] == pytest.approx(1.0)
    assert summary["spearman_all_iterations"] < 1.0
    assert np.isfinite(summary["spearman_pooled"])
    assert len(draw_figure(rows).axes) == 2


def test_plans_that_touch_nothing_are_counted_and_not_correlated() -> None:
    rows = [{"task": "a", "iteration": k, "loss": 1.0 - k, "overlap_m4": 0.0} for k in range(6)]
    summary = summarize(rows)
    assert summary["plans"] == 1 and summary["plans_that_touched"] == 0
    assert summary["spearman_median"] is None and summary["final_overlaps"] == 0
