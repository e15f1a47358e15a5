"""Cameras that are found, and such that are not."""

import pytest

from nerfnav.core.steps import run_steps
from nerfnav.experiments.relocalisation import run, summarize
from nerfnav.experiments.study import Study
from tests.experiments.places import column

ROW = {
    "kind": "sighted", "index": 0, "position_m": 0.002, "rotation_deg": 0.1, "right": True, "outcome": "found",
    "weight": 1.0, "difference_stds": 0.7, "mesh_share": 0.5, "seconds": 2.0,
}  # fmt: skip


def test_answers_that_are_sure_and_wrong_are_counted_apart_from_those_that_are_not_sure() -> None:
    wrong = ROW | {"right": False, "position_m": 0.4}
    rows = [ROW, ROW, ROW | {"outcome": "ambiguous"}, wrong, wrong | {"outcome": "lost"}]
    blind = wrong | {"kind": "any", "outcome": "ambiguous", "mesh_share": 0.0}
    summary = summarize([*rows, blind])
    assert summary["sighted"] | {"position_median_m": None} == {
        "trials": 5, "right_share": 0.6, "found_and_right": 2, "found_but_wrong": 1, "right_but_unsure": 1,
        "position_median_m": None, "rotation_median_deg": 0.1, "seconds_median": 2.0, "saw_no_mesh": 0,
    }  # fmt: skip
    assert summary["any"]["saw_no_mesh"] == 1 and summary["any"]["found_but_wrong"] == 0


@pytest.mark.slow
def test_every_picture_is_searched_for() -> None:
    results = run_steps(run(Study(column, trials=1)))
    assert [row["kind"] for row in results.rows] == ["sighted", "any"]
    assert results.rows[0]["mesh_share"] >= 0.2
    assert results.summary["sighted"]["trials"] == results.summary["any"]["trials"] == 1
    assert list(results.figures) == ["relocalisation"]
