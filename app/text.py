"""What others say in the middle of a line, as a person reads it on a line of its own."""

_ENDS = (".", "!", "?", "…")


def capital(text: str) -> str:
    """The text with a capital at its start and all else as it is: names, units and NaN stay what they are."""
    return text[:1].upper() + text[1:]


def sentence(text: str) -> str:
    """The text with a capital at its start and a full stop at its end, unless it ends already."""
    return capital(text) if text.endswith(_ENDS) else f"{capital(text)}."
