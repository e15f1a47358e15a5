"""Widget values: validate what a tab sets a widget to.

viser takes any value, and neither `min`, `max` nor `options` hold on the server.
"""

import math
from collections.abc import Callable, Sequence
from typing import Any

import viser

LARGEST = 1e9
"""Numbers beyond this are no numbers of this app, whatever they are of."""
LONGEST = 1000
"""Most characters of a text."""
_ROUNDING = 1e-6  # relative: sliders add up steps

Check = Callable[[Any, Any], bool]
"""Of a widget's properties and a value: whether a tab may set it."""


def is_number(value: Any, low: float | None = None, high: float | None = None) -> bool:
    """Check for a finite number of sensible size from `low` to `high`."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        return False
    least = -LARGEST if low is None else low - _slack(low)
    most = LARGEST if high is None else high + _slack(high)
    return least <= value <= most


def _slack(bound: float) -> float:
    """By how much rounding may take a value beyond a bound: of the bound's own size, for 0 to 2**31 has no -1."""
    return _ROUNDING * max(1.0, abs(bound))


def _is_vector(length: int) -> Check:
    def check(props: Any, value: Any) -> bool:
        lows: Sequence[float | None] = props.min or (None,) * length
        highs: Sequence[float | None] = props.max or (None,) * length
        return (
            isinstance(value, list | tuple)
            and len(value) == length
            and all(is_number(*entry) for entry in zip(value, lows, highs, strict=True))
        )

    return check


def _is_color(length: int) -> Check:
    def check(props: Any, value: Any) -> bool:
        return (
            isinstance(value, list | tuple)
            and len(value) == length
            and all(isinstance(entry, int) and is_number(entry, 0, 255) for entry in value)
        )

    return check


def _is_bool(props: Any, value: Any) -> bool:
    return isinstance(value, bool)


def _is_option(props: Any, value: Any) -> bool:
    return isinstance(value, str) and value in props.options


def _is_in_range(props: Any, value: Any) -> bool:
    return is_number(value, props.min, props.max)


def _are_in_range(props: Any, value: Any) -> bool:
    return isinstance(value, list | tuple) and all(_is_in_range(props, entry) for entry in value)


def _is_text(props: Any, value: Any) -> bool:
    return isinstance(value, str) and len(value) <= LONGEST


_CHECKS: dict[type, Check] = {
    viser.GuiButtonHandle: _is_bool,
    viser.GuiButtonGroupHandle: _is_option,
    viser.GuiCheckboxHandle: _is_bool,
    viser.GuiDropdownHandle: _is_option,
    viser.GuiMultiSliderHandle: _are_in_range,
    viser.GuiNumberHandle: _is_in_range,
    viser.GuiRgbHandle: _is_color(3),
    viser.GuiRgbaHandle: _is_color(4),
    viser.GuiSliderHandle: _is_in_range,
    viser.GuiTextHandle: _is_text,
    viser.GuiVector2Handle: _is_vector(2),
    viser.GuiVector3Handle: _is_vector(3),
}


def may_set(widget: Any, updates: dict[str, Any]) -> bool:
    """Check changes of a widget by a tab: its value alone, if it is enabled, within its range."""
    check = _CHECKS.get(type(widget))
    if check is None or set(updates) != {"value"} or widget.disabled:
        return False
    value, now = updates["value"], widget.value
    if isinstance(now, tuple) and len(value if isinstance(value, list | tuple) else ()) != len(now):
        return False
    return check(widget, value)
