"""Memory check: compare the free memory with what a computation needs, and refuse what is too large in a sentence.

What counts is the least of what the machine has left, what a container or service may have (control groups, version 1
and 2), and what the process may have (`ulimit -v`).
"""

import os
from collections.abc import Iterator
from pathlib import Path

from nerfnav.core.errors import InvalidInputError

SPARED = 0.9
"""Share of the free memory that one piece of work may take."""
_GROUPS = Path("/sys/fs/cgroup")
_NO_LIMIT = 1 << 60
"""Limits of this size mean that there is none."""


def require_memory(needed: float, what: str, advice: str) -> None:
    """Raise InvalidInputError where `what` takes more memory than there is [bytes]; `advice` says what would fit."""
    free = available_memory()
    if free is not None and needed > SPARED * free:
        raise InvalidInputError(
            f"{what} may take {needed / 1e9:.1f} GB, and {free / 1e9:.1f} GB of memory are free: {advice}"
        )


def available_memory() -> int | None:
    """Memory that this process can still have [bytes]; None where the system does not report it."""
    limits = [left for left in (_of_machine(), *_of_groups(), _of_process()) if left is not None]
    return max(0, min(limits)) if limits else None


def _of_machine() -> int | None:
    """Memory that the machine has left, cached files included, which the system gives up when needed."""
    available = _numbers(Path("/proc/meminfo"), ":").get("MemAvailable")
    if available is not None:
        return 1024 * available
    try:
        return os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (ValueError, OSError, AttributeError):
        return None


def _of_groups() -> Iterator[int]:
    """Memory that each control group of the process has left."""
    for line in _text(Path("/proc/self/cgroup")).splitlines():
        _, kinds, path = line.split(":", 2)
        if kinds == "":
            root, names = _GROUPS, ("memory.max", "memory.current", "inactive_file")
        elif "memory" in kinds.split(","):
            root = _GROUPS / "memory"
            names = ("memory.limit_in_bytes", "memory.usage_in_bytes", "total_inactive_file")
        else:
            continue
        # in a container the path may be that of the host, of which only the root is there
        inside = root / path.lstrip("/")
        for group in (inside, *inside.parents):
            if group.is_relative_to(root):
                yield from _of_group(group, names)


def _of_group(group: Path, names: tuple[str, str, str]) -> Iterator[int]:
    limit, used, files = names
    most, taken = _text(group / limit).strip(), _text(group / used).strip()
    if most.isdecimal() and taken.isdecimal() and int(most) < _NO_LIMIT:
        cached = _numbers(group / "memory.stat", " ").get(files, 0)
        yield int(most) - int(taken) + cached


def _of_process() -> int | None:
    """Memory that the process may still map, where that is limited."""
    try:
        import resource

        most, _ = resource.getrlimit(resource.RLIMIT_AS)
        if most == resource.RLIM_INFINITY:
            return None
        pages = _text(Path("/proc/self/statm")).split()
        return most - int(pages[0]) * resource.getpagesize() if pages else None
    except (ImportError, OSError, ValueError):
        return None


def _text(path: Path) -> str:
    """Text of a file of the system; empty where there is none."""
    try:
        return path.read_text()
    except (OSError, UnicodeDecodeError):
        return ""


def _numbers(path: Path, mark: str) -> dict[str, int]:
    """Names and whole numbers of a table, one a line."""
    rows = (line.split(mark, 1) for line in _text(path).splitlines() if mark in line)
    words = ((name, rest.split()) for name, rest in rows)
    return {name: int(rest[0]) for name, rest in words if rest and rest[0].isdecimal()}
