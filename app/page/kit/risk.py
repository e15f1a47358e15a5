"""Risk look: text and colour of a collision probability or an expected sigma, the same wherever the page shows one."""

from collections.abc import Callable
from dataclasses import dataclass

from nerfnav.navigation import ExpectedSigma
from nerfnav_app.page.kit.html import caution, fine, warning
from nerfnav_app.page.kit.theme import CAUTION, HIT, START, Rgb
from nerfnav_app.state.plan import RiskLevel, classify_blindness, classify_risk

_COLORS = {RiskLevel.LOW: START, RiskLevel.MODERATE: CAUTION, RiskLevel.HIGH: HIT}
_FORMATS = {RiskLevel.LOW: fine, RiskLevel.MODERATE: caution, RiskLevel.HIGH: warning}
_LEAST_SHARE = 0.001
"""Probabilities are estimated from some thousand samples: below this they are not distinguished."""


@dataclass(frozen=True)
class RiskLook:
    """Look of a risk: its text, colour and format."""

    text: str
    """Number and word, such as "4 %, moderate"."""
    color: Rgb
    """Green where the risk is low, amber where it is moderate, red where it is high."""
    html: Callable[[str], str]
    """Format of a sentence about it."""


def look_of_risk(probability: float) -> RiskLook:
    """Choose text and colour of a collision probability, 0 to 1."""
    level = classify_risk(probability)
    percent = 100 * probability
    share = "under 0.1 %" if probability < _LEAST_SHARE else f"{percent:.1f} %" if percent < 10 else f"{percent:.0f} %"
    return RiskLook(f"{share}, {level.value}", _COLORS[level], _FORMATS[level])


def look_of_sigma(expected: ExpectedSigma) -> RiskLook:
    """Choose text and colour of what the views along a plan will tell."""
    level, blind = classify_blindness(expected.blind_share), ""
    if expected.blind_share:
        blind = f", too little to see on {max(1, round(100 * expected.blind_share))} % of the way"
    return RiskLook(f"{100 * expected.median_m:.2g} cm{blind}", _COLORS[level], _FORMATS[level])
