"""Checks of types and shapes in tests: of the first calls of each function of nerfnav in each test.

jaxtyping binds and checks the arguments of each call anew. For functions that a test calls thousands of times, that
took a third of the time of all tests, and told nothing more. Functions without shapes are left to beartype alone.
"""

import dataclasses
import functools
import inspect
import typing
from collections.abc import Callable
from typing import Any

import jaxtyping
from beartype import BeartypeConf, beartype

check = beartype(conf=BeartypeConf(is_pep484_tower=True))
"""beartype, with integers welcome where floats are asked for."""
CALLS = 3
"""Calls of each function that are checked in each test."""
_every_call = jaxtyping.jaxtyped
_test = 0


def begin_test() -> None:
    """Check the first calls of each function again."""
    global _test
    _test += 1


def check_first_calls(function: Any = None, *, typechecker: Any) -> Any:
    """Decorate as `jaxtyping.jaxtyped` does: functions, and the fields of dataclasses.

    Only the first CALLS calls in each test are checked; the check is prepared when it is first needed.
    """
    if function is None:
        return functools.partial(check_first_calls, typechecker=typechecker)
    if inspect.isfunction(function):
        return _checked_at_first(function, typechecker)
    if not inspect.isclass(function):
        return _every_call(function, typechecker=typechecker)
    if dataclasses.is_dataclass(function) and "__init__" in vars(function):
        made: Any = function
        made.__init__ = _checked_at_first(made.__init__, typechecker)
    return function


def _checked_at_first(function: Callable[..., Any], typechecker: Any) -> Callable[..., Any]:
    checked: Callable[..., Any] | None = None
    seen_in, calls = -1, 0

    @functools.wraps(function)
    def call(*arguments: Any, **named: Any) -> Any:
        __tracebackhide__ = True
        nonlocal checked, seen_in, calls
        if seen_in != _test:
            seen_in, calls = _test, 0
        if calls >= CALLS:
            return function(*arguments, **named)
        calls += 1
        if checked is None:
            shaped = any(_has_shape(kind) for kind in inspect.get_annotations(function).values())
            checked = _every_call(function, typechecker=typechecker) if shaped else typechecker(function)
        return checked(*arguments, **named)

    return call


def _has_shape(kind: Any) -> bool:
    """Check whether an annotation has arrays with shapes in it, or a name, which may stand for such."""
    return isinstance(kind, str | type(jaxtyping.AbstractArray)) or any(map(_has_shape, typing.get_args(kind)))


def use() -> None:
    """Let jaxtyping's import hook decorate functions by `check_first_calls`; before nerfnav is imported."""
    hooked: Callable[..., Any] = check_first_calls
    jaxtyping.jaxtyped = hooked
