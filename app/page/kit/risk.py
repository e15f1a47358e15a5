"""Risk look: text and colour of a collision probability, the same wherever the page shows one."""

from collections.abc import Callable
from dataclasses import dataclass

from nerfnav_app.page.kit.html import caution, fine, warning
from nerfnav_app.page.kit.theme import CAUTION, HIT, START, Rgb
from nerfnav_app.state.plan import RiskLevel, classify_risk

_COLORS = {RiskLevel.LOW: START, RiskLevel.MODERATE: CAUTION, RiskLevel.HIGH: HIT}
_FORMATS = {RiskLevel.LOW: fine, RiskLevel.MODERATE: caution, RiskLevel.HIGH: warning}
_LEAST_SHARE = 0.001
"""Probabilities are estimated from some thousand samples: below this they are not distinguished."""


@dataclass(frozen=True)
class RiskLook:
    """Look of a collision probability: its text, colour and format."""

    text: str
    """Share and word, such as "4 %, moderate"."""
    color: Rgb
    """Green under 1 %, amber to 10 %, red above."""
    html: Callable[[str], str]
    """Format of a sentence about it."""


def look_of_risk(probability: float) -> RiskLook:
    """Choose text and colour of a collision probability, 0 to 1."""
    level = classify_risk(probability)
    percent = 100 * probability
    share = "under 0.1 %" if probability < _LEAST_SHARE else f"{percent:.1f} %" if percent < 10 else f"{percent:.0f} %"
    return RiskLook(f"{share}, {level.value}", _COLORS[level], _FORMATS[level])
