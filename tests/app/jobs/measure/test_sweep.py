"""Sweeps: values of a setting, their combinations, and what is refused."""

import pytest

from nerfnav.core.errors import InvalidInputError
from nerfnav_app.jobs.measure.sweep import Sweep, combine, label_of, parse_sweeps


def test_values_have_the_type_of_their_setting() -> None:
    words = ["risk-weight=0.3,1,3", "fly_on=yes,no", "seed=4", "--world=paper,physical", "robot=x500"]
    assert parse_sweeps(words) == (
        Sweep("risk_weight", (0.3, 1.0, 3.0)), Sweep("fly_on", (True, False)), Sweep("seed", (4,)),
        Sweep("world", ("paper", "physical")), Sweep("robot", ("x500",)),
    )  # fmt: skip


def test_several_sweeps_are_combined() -> None:
    combinations = combine(parse_sweeps(["risk-weight=1,3", "world=paper,physical"]))
    assert [label_of(known) for known in combinations] == [
        "risk-weight=1, world=paper", "risk-weight=1, world=physical",
        "risk-weight=3, world=paper", "risk-weight=3, world=physical",
    ]  # fmt: skip
    assert combine(()) == [{}]


@pytest.mark.parametrize(
    ("word", "message"),
    [
        ("risk-wieght=1", "no setting 'risk-wieght', the nearest is risk-weight; known are: ends, fly-on"),
        ("sed=1", "the nearest is seed"),
        ("=1", "no setting ''"),
        ("seed", "needs values, each once, such as seed=A,B"),
        ("seed=", "--sweep seed takes whole numbers, not ''"),
        ("seed=1,1", "needs values, each once"),
        ("seed=1.5", "--sweep seed takes whole numbers, not '1.5'"),
        ("risk-weight=1,,2", "--sweep risk-weight takes numbers, not ''"),
        ("risk-weight=heavy", "--sweep risk-weight takes numbers, not 'heavy'"),
        ("world=mars", "--sweep world takes paper, physical, not 'mars'"),
        ("truth=maybe", "--sweep truth takes false, no, true, yes, not 'maybe'"),
        (f"seed={','.join(map(str, range(101)))}", "asks for 101 combinations"),
    ],
)
def test_other_sweeps_are_refused_in_one_sentence(word: str, message: str) -> None:
    with pytest.raises(InvalidInputError) as refused:
        parse_sweeps([word])
    assert message in str(refused.value) and "\n" not in str(refused.value)


def test_a_setting_is_swept_once() -> None:
    with pytest.raises(InvalidInputError, match="has seed twice"):
        parse_sweeps(["seed=1", "seed=2"])
