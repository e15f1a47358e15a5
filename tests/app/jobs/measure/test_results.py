"""Tables of results for readers, and percentiles."""

import pytest

from nerfnav.experiments import Results
from nerfnav_app.jobs.measure.results import PERCENTILES, cell_text, percentiles_of, tables_of


def test_records_of_one_kind_are_columns_and_others_have_tables_of_their_own() -> None:
    loops = {"closed": {"reached": 3, "share": 0.75}, "open": {"reached": 0, "share": None}}
    summary = {"trials": 4, "places": {"here": loops}, "left_out": {"rrt": "it is missing"}, "failed": [{"trial": 2}]}
    assert tables_of(summary) == [
        "|  | value |\n| --- | --- |\n| trials | 4 |",
        "## places",
        "## places, here",
        "|  | closed | open |\n| --- | --- | --- |\n| reached | 3 | 0 |\n| share | 0.75 | – |",
        "## left out",
        "|  | value |\n| --- | --- |\n| rrt | it is missing |",
        "## failed",
        "| trial |\n| --- |\n| 2 |",
    ]


def test_nested_records_of_one_kind_are_one_table() -> None:
    summary = {name: {"closed": {"reached": reached}} for name, reached in (("a", 1), ("b", 2))}
    assert tables_of(summary) == ["|  | a | b |\n| --- | --- | --- |\n| closed.reached | 1 | 2 |"]


@pytest.mark.parametrize(
    ("value", "text"),
    [(True, "yes"), (None, "–"), (1 / 3, "0.3333"), ([1.0, "a|b"], "1, a\\|b"), ("two\nlines", "two lines"), (2, "2")],
)
def test_a_cell_is_one_line_that_does_not_break_its_table(value: object, text: str) -> None:
    assert cell_text(value) == text


def test_percentiles_are_those_of_each_group_over_the_numbers_alone() -> None:
    rows = tuple({"kind": "a" if index else "b", "seed": index, "error": float(index), "hit": True, "ms": None}
                 for index in range(102))  # fmt: skip
    assert percentiles_of(Results({}, rows, by=("kind",))) == [
        {"kind": "b", "measure": "error", "n": 1} | dict.fromkeys(PERCENTILES, 0.0),
        {"kind": "a", "measure": "error", "n": 101, "p5": 6.0, "p25": 26.0, "median": 51.0, "p75": 76.0, "p95": 96.0},
    ]


def test_values_that_are_not_finite_and_tables_without_lines_give_no_percentiles() -> None:
    assert percentiles_of(Results({}, ({"error": float("nan")}, {"error": float("inf")}))) == []
    assert percentiles_of(Results({}, ({"error": 1.0},), sample=())) == []
