"""Recursive retraction against a single tangent plane."""

import pytest

from nerfnav.experiments.tangent import LARGE, METHODS, SMALL, Start, compare, summary_of
from tests.experiments.places import column


def test_both_start_alike_and_go_down() -> None:
    rows = compare(column(), Start(seed=1, error=LARGE, iterations=12))
    courses = [[row for row in rows if row["method"] == method] for method in METHODS]
    assert [len(course) for course in courses] == [13, 13]
    assert courses[0][0] | {"method": ""} == courses[1][0] | {"method": ""}
    assert all(course[0]["rotation_rad"] == pytest.approx(LARGE, rel=1e-3) for course in courses)
    assert all(course[-1]["cost"] < course[0]["cost"] for course in courses)
    assert courses[0][-1]["rotation_rad"] != courses[1][-1]["rotation_rad"]


def test_the_summary_tells_how_many_arrived_and_how_soon() -> None:
    def row(method: str, iteration: int, off: float, error: float) -> dict[str, object]:
        return {"seed": 0, "start_rad": error, "method": method, "iteration": iteration, "cost": 100 * off,
                "position_m": 0.0, "rotation_rad": off}  # fmt: skip

    course = (0.6, 0.3, 0.05, 0.01)
    rows = [
        row(method, index, off, error)
        for error in (SMALL, LARGE) for method in METHODS for index, off in enumerate(course)
    ]  # fmt: skip
    found = summary_of(rows)["from_0.6_rad"]["recursive"]
    assert found["converged"] == 1 and found["iterations_to_a_tenth_median"] == 2
    assert found["final_rotation_rad_median"] == pytest.approx(0.01)
