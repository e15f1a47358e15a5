"""Texts from elsewhere become sentences, and nothing in them changes that means something."""

import pytest

from nerfnav_app.text import capital, sentence


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("the goal is NaN", "The goal is NaN."),
        ("no path, 3 m of Stonehenge", "No path, 3 m of Stonehenge."),
        ("all is well.", "All is well."),
        ("where?", "Where?"),
        ("planning…", "Planning…"),
        ("ärger", "Ärger."),
        ("1 m is too far", "1 m is too far."),
    ],
)
def test_a_text_becomes_a_sentence(text: str, told: str) -> None:
    assert sentence(text) == told


def test_a_label_gets_its_capital_alone() -> None:
    assert capital("body rate at A*") == "Body rate at A*"
    assert capital("") == ""
