"""Sweeps: an experiment with each value of a setting, or with each combination of the values of several."""

import difflib
import itertools
import types
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

from nerfnav.core.errors import InvalidInputError
from nerfnav.experiments import FlightOptions, Results, Row
from nerfnav.experiments.figures import Figure, bars, panels
from nerfnav_app.jobs.measure.results import flatten

_SETTINGS: dict[str, Any] = {"seed": int, "place": str, **get_type_hints(FlightOptions)}
"""Settings that can be swept, with their types."""
_MOST = 100
"""Combinations of a sweep."""
_BOOLS = {"yes": True, "true": True, "no": False, "false": False}


@dataclass(frozen=True)
class Sweep:
    """Values of one setting."""

    setting: str
    """Name of the setting, as a field."""
    values: tuple[Any, ...]
    """Its values, of its type."""


def parse_sweeps(words: Sequence[str]) -> tuple[Sweep, ...]:
    """Read sweeps such as risk-weight=0.3,1,3. Raises InvalidInputError for others, and for unknown settings."""
    sweeps = tuple(_parse(word) for word in words)
    names = [sweep.setting for sweep in sweeps]
    for name in names:
        if names.count(name) > 1:
            raise InvalidInputError(f"--sweep has {_option(name)} twice: give all of its values at once")
    count = len(combine(sweeps))
    if count > _MOST:
        raise InvalidInputError(f"--sweep asks for {count} combinations: at most {_MOST} go into one table")
    return sweeps


def combine(sweeps: Sequence[Sweep]) -> list[dict[str, Any]]:
    """List the combinations of the values, each from setting to value; one empty one without a sweep."""
    names = [sweep.setting for sweep in sweeps]
    return [
        dict(zip(names, values, strict=True)) for values in itertools.product(*(sweep.values for sweep in sweeps))
    ]


def label_of(combination: Mapping[str, Any]) -> str:
    """Name a combination, such as risk-weight=3, world=paper."""
    return ", ".join(f"{_option(name)}={_shown(value)}" for name, value in combination.items())


def merge(combinations: Sequence[dict[str, Any]], found: Sequence[Results], headline: Sequence[str]) -> Results:
    """Join the results of each combination: one table with a column sweep_SETTING for each setting, one figure."""
    rows: list[Row] = []
    sample: list[Row] = []
    columns = [{f"sweep_{name}": value for name, value in known.items()} for known in combinations]
    for known, results in zip(columns, found, strict=True):
        rows += [known | row for row in results.rows]
        sample += [known | row for row in (results.rows if results.sample is None else results.sample)]
    labels = [label_of(known) for known in combinations]
    summaries = {label: results.summary for label, results in zip(labels, found, strict=True)}
    figures = {"sweep": partial(draw_figure, summaries, headline)}
    return Results({"sweep": summaries}, tuple(rows), figures, (*columns[0], *found[0].by), tuple(sample))


def draw_figure(summaries: Mapping[str, Row], headline: Sequence[str]) -> Figure:
    """Draw a bar for each combination in a panel for each headline number; without any, the first three numbers."""
    flat = {label: _numbers(summary) for label, summary in summaries.items()}
    shared = [name for name in next(iter(flat.values())) if all(name in numbers for numbers in flat.values())]
    names = [name for name in headline if name in shared] or shared[:3] or ["no number"]
    figure, axes = panels([name.replace("_", " ") for name in names])
    for panel, name in zip(axes, names, strict=True):
        bars(panel, {label.replace(", ", "\n"): numbers.get(name, 0.0) for label, numbers in flat.items()}, "")
        panel.tick_params(axis="x", labelsize=7, labelrotation=0 if len(flat) < 5 else 60)
    return figure


def _numbers(summary: Row) -> dict[str, float]:
    found = dict(flatten(summary)).items()
    return {name: value for name, value in found if isinstance(value, int | float) and not isinstance(value, bool)}


def _parse(word: str) -> Sweep:
    option, equals, texts = word.partition("=")
    name = option.strip().removeprefix("--").replace("-", "_")
    known = [_option(entry) for entry in _SETTINGS]
    if name not in _SETTINGS:
        (nearest,) = difflib.get_close_matches(_option(name), known, 1, cutoff=0.0)
        raise InvalidInputError(
            f"--sweep has no setting {option!r}, the nearest is {nearest}; known are: {', '.join(sorted(known))}"
        )
    values = tuple(_value(name, text.strip()) for text in texts.split(",")) if equals else ()
    if len(set(values)) < max(1, len(values)):
        raise InvalidInputError(f"--sweep {word} needs values, each once, such as {_option(name)}=A,B")
    return Sweep(name, values)


def _value(name: str, text: str) -> Any:
    """Convert a text to the type of a setting. Raises InvalidInputError, which says what is needed."""
    kind = _SETTINGS[name]
    if get_origin(kind) in (Union, types.UnionType):
        kind = next(part for part in get_args(kind) if part is not type(None))
    if get_origin(kind) is Literal:
        choices: dict[str, Any] = {choice: choice for choice in get_args(kind)}
    elif kind is bool:
        choices = _BOOLS
    else:
        try:
            if text:
                return kind(text)
        except ValueError:
            pass
        wanted = {int: "whole numbers", float: "numbers"}.get(kind, "names")
        raise InvalidInputError(f"--sweep {_option(name)} takes {wanted}, not {text!r}")
    if text not in choices:
        raise InvalidInputError(f"--sweep {_option(name)} takes {', '.join(sorted(choices))}, not {text!r}")
    return choices[text]


def _option(name: str) -> str:
    return name.replace("_", "-")


def _shown(value: Any) -> str:
    return ("no", "yes")[value] if isinstance(value, bool) else f"{value:g}" if isinstance(value, float) else str(value)
