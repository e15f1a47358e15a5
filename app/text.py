"""Text formatting: sentences, and numbers with their units."""

_ENDS = (".", "!", "?", "…")


def capital(text: str) -> str:
    """Capitalize the first letter; names, units and NaN stay as they are."""
    return text[:1].upper() + text[1:]


def sentence(text: str) -> str:
    """Capitalize the first letter and add a full stop, unless the text ends with punctuation."""
    return capital(text) if text.endswith(_ENDS) else f"{capital(text)}."


def format_wait(seconds: float) -> str:
    """Format a waiting time [s], rounded."""
    return f"{max(1, round(seconds / 5)) * 5} s" if seconds < 90 else f"{round(seconds / 60)} min"


def number(value: float, unit: str, digits: int = 3) -> str:
    """Format a number to `digits` digits, with its unit."""
    text = f"{value:.{digits}g}" if abs(value) < 10**digits else f"{value:.0f}"
    return f"{text} {unit}".rstrip()
