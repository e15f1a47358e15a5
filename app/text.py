"""Wording: sentences and numbers with units as a person reads them."""

_ENDS = (".", "!", "?", "…")


def capital(text: str) -> str:
    """The text with a capital at its start and all else as it is: names, units and NaN stay what they are."""
    return text[:1].upper() + text[1:]


def sentence(text: str) -> str:
    """The text with a capital at its start and a full stop at its end, unless it ends already."""
    return capital(text) if text.endswith(_ENDS) else f"{capital(text)}."


def number(value: float, unit: str, digits: int = 3) -> str:
    """A number as a person reads it, with its unit."""
    text = f"{value:.{digits}g}" if abs(value) < 10**digits else f"{value:.0f}"
    return f"{text} {unit}".rstrip()
