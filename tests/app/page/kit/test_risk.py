"""Colour and word of a collision probability."""

import pytest

from nerfnav_app.page.kit.html import caution, fine, table, warning
from nerfnav_app.page.kit.risk import look_of_risk
from nerfnav_app.page.kit.theme import CAUTION, HIT, START, readable
from nerfnav_app.state.plan import RiskLevel, classify_risk


@pytest.mark.parametrize(
    ("probability", "level", "text"),
    [
        (0.0, RiskLevel.LOW, "under 0.1 %, low"),
        (0.0099, RiskLevel.LOW, "1.0 %, low"),
        (0.01, RiskLevel.MODERATE, "1.0 %, moderate"),
        (0.1, RiskLevel.MODERATE, "10 %, moderate"),
        (0.46, RiskLevel.HIGH, "46 %, high"),
        (1.0, RiskLevel.HIGH, "100 %, high"),
    ],
)
def test_risk_is_green_under_one_percent_amber_to_ten_and_red_above(
    probability: float, level: RiskLevel, text: str
) -> None:
    look = look_of_risk(probability)
    assert classify_risk(probability) is level and look.text == text
    colors = {RiskLevel.LOW: START, RiskLevel.MODERATE: CAUTION, RiskLevel.HIGH: HIT}
    formats = {RiskLevel.LOW: fine, RiskLevel.MODERATE: caution, RiskLevel.HIGH: warning}
    assert look.color == colors[level] and look.html is formats[level]


def test_the_value_of_a_row_has_its_colour() -> None:
    assert f"color: {readable(HIT)}" in table([("Risk", "46 %", "", readable(HIT))])
    assert "color: inherit" in table([("Risk", "46 %")])
