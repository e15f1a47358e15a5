"""Just-in-time compilation of kernels: one decorator, one cache (nerfnav/core/kernel_cache.py), one limit on threads.

numba itself is imported when a kernel is first called: it takes a fifth of a second, and the user waits for the page.
"""

import inspect
import os
from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext, suppress
from contextvars import ContextVar
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import numpy as np
import torch

from nerfnav.core.errors import InvalidInputError, require_positive
from nerfnav.core.kernel_cache import cache_folder, caching, can_be_kept, require_covered

_PATIENCE_S = 120
"""Longest wait of a process for another one that compiles the same kernel [s]."""
_FAST = {"nsz", "arcp", "contract", "afn", "reassoc"}  # all but nnan and ninf: NaN must stay visible

prange = range
"""`range` whose iterations run in parallel in a parallel kernel."""
_ANY = 1 << 30
_allowed: ContextVar[int] = ContextVar("threads that kernels may use", default=1)
_bound: ContextVar[int] = ContextVar("threads that blocks inside may ask for", default=_ANY)
_default: ContextVar[int | None] = ContextVar("threads of large work", default=None)
_compiling: ContextVar[Callable[[int], None]] = ContextVar("listener of compilations", default=lambda change: None)
"""Called with 1 when a compilation begins, and with -1 when it ends."""


class Kernel:
    """A function that is compiled, or its machine code read from the cache, when it is first called."""

    def __init__(self, function: Any, options: dict[str, Any]) -> None:
        """`options` are those of numba's `njit`."""
        self._function, self._options = function, options
        self.__doc__, self.__name__ = function.__doc__, function.__name__

    def __call__(self, *arguments: Any) -> Any:
        """Call the compiled function with these arrays and numbers."""
        side_by_side = self._options.get("parallel") and _allowed.get() > 1
        return (self._dispatcher if side_by_side else self._serial)(*arguments)

    @property
    def _numba_type_(self) -> Any:
        """Type of the kernel for numba, where other kernels call it."""
        return self._inlined._numba_type_

    @cached_property
    def _inlined(self) -> Any:
        """The same as a part of the kernels that call it.

        As a function of its own it would be in the machine code of each caller, rounded as that caller's compilation
        fused its operations, and the copy that is loaded first would serve all: results would depend on the order.
        """
        part = {"cache": False, "forceinline": True, "no_cpython_wrapper": True, "no_cfunc_wrapper": True}
        made = self._made(self._options | part | {"pipeline_class": _compiler_of_parts()}, cache_folder())
        resolved = made.get_call_template
        made.get_call_template = lambda arguments, named: resolved(_without_values(arguments), named)
        return made

    @cached_property
    def _dispatcher(self) -> Any:
        return self._made(self._options, cache_folder())

    @cached_property
    def _serial(self) -> Any:
        """The same for one thread: a parallel kernel would wake up a pool of threads even for one."""
        if not self._options.get("parallel"):
            return self._dispatcher
        # in a folder of its own: numba's cache does not separate the two
        return self._made(self._options | {"parallel": False}, cache_folder() / "serial")

    def _made(self, options: dict[str, Any], folder: Path) -> Any:
        import numba
        from numba.core.compiler_lock import global_compiler_lock

        require_covered(self.__name__, self._function.__code__.co_filename)
        _listen()
        names = self._function.__globals__
        if names.get("prange") is prange:
            names["prange"] = numba.prange  # which numba knows by identity
        settings: dict[str, Any] = options | {"cache": options.get("cache") and can_be_kept()}
        with global_compiler_lock, caching(folder):
            dispatcher: Any = numba.njit(**settings)(self._function)
        if settings["cache"]:
            dispatcher.compile = _in_one_process(dispatcher.compile, folder / f"{self.__name__}.lock")
        return dispatcher


def kernel(*, parallel: bool = False, exact: bool = False) -> Callable[[Any], Kernel]:
    """Compile a function with numba, cached, without the interpreter's lock.

    Where another kernel calls it, it becomes a part of that one. `exact` keeps each operation as it is written, so that
    it rounds as numpy does.
    """

    def decorate(function: Any) -> Kernel:
        fastmath = set() if exact else _FAST
        options = {"nogil": True, "error_model": "numpy", "parallel": parallel, "fastmath": fastmath, "cache": True}
        # unwrapped: when shapes are checked, every function of the package comes in a wrapper
        return Kernel(inspect.unwrap(function), options)

    return decorate


def array_of(tensor: torch.Tensor) -> np.ndarray:
    """Convert a tensor for kernels: 64 bits, contiguous."""
    return np.ascontiguousarray(tensor.detach().double().numpy())


def _without_values(types: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return types without the values of whole numbers, for each of which numba would compile a part anew.

    These are in the types of numbers as they stand in a call, and of those that a variable begins with.
    """
    from numba.core.types import Tuple, UniTuple, unliteral

    return tuple(
        type(one).from_types(_without_values(one.types)) if isinstance(one, Tuple | UniTuple) else unliteral(one)
        for one in types
    )


@cache
def _compiler_of_parts() -> Any:
    """Make numba's compiler leave a function that is a part of others unoptimised and without machine code.

    Its callers optimise it once more where it stands, and it is never called on its own: a third of the time saved.
    """
    from numba.core.codegen import JITCodeLibrary
    from numba.core.compiler import Compiler

    class Codegen:
        """Code generator of this machine, for code that has no address in it."""

        def __init__(self, machine: Any) -> None:
            self._machine = machine

        def __getattr__(self, name: str) -> Any:
            return getattr(self._machine, name)

        def set_env(self, name: str, env: Any) -> None:
            """Leave out the environment, with which Python would call the function."""

    class Part(JITCodeLibrary):
        def _optimize_final_module(self) -> None:
            pass

        def _finalize_final_module(self) -> None:
            self._finalize_dynamic_globals()
            self._finalized = True

        def get_pointer_to_function(self, name: str) -> int:
            self._ensure_finalized()
            return 0

    class PartCompiler(Compiler):
        def compile_extra(self, func: Any) -> Any:
            codegen: Any = Codegen(self.state.targetctx.codegen())
            self.state.library = Part(codegen, func.__qualname__)
            return super().compile_extra(func)

    return PartCompiler


def _in_one_process(compiled: Callable[[Any], Any], path: Path) -> Callable[[Any], Any]:
    """Let one process compile a kernel: the others wait for it, and then read side by side what it has made."""

    def compile_or_wait(signature: Any) -> Any:
        from filelock import FileLock

        lock = FileLock(path)
        with suppress(OSError):  # another process is suspended, or the cache cannot be written: nothing is shared
            path.parent.mkdir(parents=True, exist_ok=True)
            _wait_for(lock)
        try:
            return compiled(signature)
        finally:
            lock.release()

    return compile_or_wait


def _wait_for(lock: Any) -> None:
    """Take a lock, or wait until it is free; to wait is reported as a compilation. Raises Timeout after _PATIENCE_S."""
    from filelock import Timeout

    try:
        lock.acquire(timeout=0)
    except Timeout:
        _compiling.get()(1)
        try:
            lock.acquire(timeout=_PATIENCE_S)
            lock.release()
        finally:
            _compiling.get()(-1)


@contextmanager
def report_compilation(report: Callable[[bool], None]) -> Iterator[None]:
    """Call `report` with True when this thread begins to compile a kernel inside the block, with False when it ends.

    It may take a minute. Machine code that is read from the cache is no compilation.
    """
    going_on = 0  # a kernel is compiled while one that calls it is

    def count(change: int) -> None:
        nonlocal going_on
        going_on += change
        if going_on == max(change, 0):
            report(going_on > 0)

    before = _compiling.set(count)
    try:
        yield
    finally:
        _compiling.reset(before)


@cache
def _listen() -> None:
    """Hear of everything that numba compiles from now on, in the thread in which it does."""
    from numba.core import event

    class Listener(event.Listener):
        def on_start(self, event: Any) -> None:
            _compiling.get()(1)

        def on_end(self, event: Any) -> None:
            _compiling.get()(-1)

    event.register("numba:compile", Listener())


def count_cores() -> int:
    """Count the cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 2


def default_threads() -> int:
    """Threads of large work, such as training: those of `use_threads`.

    Else all cores but one, which is left to the web server and the rest; at least 1.
    """
    return _default.get() or max(1, count_cores() - 1)


@contextmanager
def use_threads(count: int | None) -> Iterator[None]:
    """Let large work inside the block have `count` threads; None: one on each core.

    Plans and filters keep the one that they ask for. Raises InvalidInputError for a count that is not positive, and for
    more threads than there are cores.
    """
    cores = count_cores()
    require_positive(threads=count)
    if count is not None and count > cores:
        raise InvalidInputError(f"threads must be at most {cores}, the cores that this process may use, not {count}")
    before = _default.set(count or cores)
    try:
        yield
    finally:
        _default.reset(before)


@contextmanager
def threads(count: int) -> Iterator[int]:
    """Let kernels inside the block use at most `count` threads; yields how many they really use.

    Outside any block they use one, and a block inside another one gets no more than that has: plans and filters
    ask for one, whatever they call. A block for one thread wakes up no pool.

    Both numba and torch run on OpenMP, and a parallel kernel leaves torch with all cores, on which its small tensors
    are ten times slower beside another busy process: torch gets back the number that it had.
    """
    wanted, before = max(1, min(count, _bound.get())), (_allowed.get(), _bound.get())
    _bound.set(wanted)
    try:
        with _pool(wanted) if wanted > 1 else nullcontext(1) as used:
            _allowed.set(used)
            yield used
    finally:
        _allowed.set(before[0])
        _bound.set(before[1])


@contextmanager
def _pool(count: int) -> Iterator[int]:
    """Threads of numba's, as many as there are and at most `count`."""
    import numba

    used = min(count, numba.config.NUMBA_NUM_THREADS)  # type: ignore[attr-defined]
    # torch first: the first question to numba starts its threads, and torch then answers with their number
    torch_before, before = torch.get_num_threads(), numba.get_num_threads()
    numba.set_num_threads(used)
    try:
        yield used
    finally:
        numba.set_num_threads(before)
        torch.set_num_threads(torch_before)
