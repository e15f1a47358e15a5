"""Recursive retraction against a single tangent plane."""

import numpy as np
import pytest

from nerfnav.experiments.tangent import ERRORS, METHODS, Start, compare, draw_figure, summarize
from tests.experiments.places import column


def test_both_start_alike_and_go_down() -> None:
    rows = compare(column(), Start(seed=5, error=0.5, iterations=16))
    courses = [[row for row in rows if row["method"] == method] for method in METHODS]
    assert [len(course) for course in courses] == [17, 17]
    assert courses[0][0] | {"method": ""} == courses[1][0] | {"method": ""}
    assert all(course[0]["rotation_rad"] == pytest.approx(0.5, rel=1e-3) for course in courses)
    assert all(course[-1]["cost"] < 0.1 * course[0]["cost"] for course in courses)
    assert all(course[-1]["rotation_rad"] < course[0]["rotation_rad"] for course in courses)
    assert courses[0][-1]["rotation_rad"] != courses[1][-1]["rotation_rad"]


def test_the_summary_tells_how_many_arrived_and_how_soon() -> None:
    def row(method: str, iteration: int, off: float, error: float) -> dict[str, object]:
        return {"seed": 0, "start_rad": error, "method": method, "iteration": iteration, "cost": 100 * off,
                "position_m": 0.0, "rotation_rad": off}  # fmt: skip

    course = (0.6, 0.3, 0.05, 0.01)
    rows = [
        row(method, index, off, error)
        for error in ERRORS for method in METHODS for index, off in enumerate(course)
    ]  # fmt: skip
    rows += [row(method, index, 0.6, error) | {"seed": 1} for error in ERRORS for method in METHODS for index in (0, 1)]
    found = summarize(rows)["from_0.6_rad"]["recursive"]
    assert found["trials"] == 2 and found["converged"] == 0.5
    assert found["final_rotation_rad_median"] == pytest.approx((0.01 + 0.6) / 2)


def test_the_summary_tells_how_soon_the_cost_is_down() -> None:
    def row(method: str, iteration: int, cost: float, error: float) -> dict[str, object]:
        return {"seed": 0, "start_rad": error, "method": method, "iteration": iteration, "cost": cost,
                "position_m": 0.0, "rotation_rad": 0.0}  # fmt: skip

    rows = [row(method, index, cost, error) for error in ERRORS for method in METHODS
            for index, cost in enumerate((100.0, 50.0, 8.0, 1.0))]  # fmt: skip
    assert summarize(rows)["from_0.1_rad"]["single plane"]["iterations_to_a_tenth_median"] == 2


def test_the_picture_has_a_panel_for_each_error() -> None:
    rows = [row | {"start_rad": error, "seed": seed} for error in ERRORS for seed in (0, 1)
            for row in compare(column(), Start(seed=seed, error=error, iterations=2))]  # fmt: skip
    axes = draw_figure(rows).axes
    assert len(axes) == len(ERRORS)
    medians = [line for line in axes[0].lines if line.get_label() in METHODS]
    curves = [np.asarray(line.get_ydata()) for line in medians]
    assert [len(curve) for curve in curves] == [3, 3]
    assert curves[0][0] == pytest.approx(ERRORS[0], rel=1e-3)
