"""What jobs tell their consumers (the command line, the browser): frozen values, in the order in which they happen.

A job is a generator of events. Library steps (PlanStep, FilterStep, NavigationStep, TrainStep) are events as they
are; what else a job has to say stands here.
"""

from collections.abc import Generator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from nerfnav.field.train import TrainStep
from nerfnav.navigation.steps import LoopEvent


@dataclass(frozen=True)
class Progress:
    """How far a job is."""

    label: str
    """What is being done, e.g. "optimising"."""
    fraction: float
    """0 to 1."""


@dataclass(frozen=True)
class JobStarted:
    """A job has begun."""

    name: str
    """What it is called, e.g. "plan"."""


@dataclass(frozen=True)
class JobFinished:
    """A job has done what was asked."""

    name: str
    """What it is called."""
    summary: dict[str, Any] = field(default_factory=dict)
    """Its numbers: what `--json` prints."""
    files: tuple[Path, ...] = ()
    """What it wrote."""


@dataclass(frozen=True)
class JobFailed:
    """A job has ended without doing what was asked."""

    name: str
    """What it is called."""
    message: str
    """One sentence for the user."""


@dataclass(frozen=True)
class JobCancelled:
    """A job was stopped by the user."""

    name: str
    """What it is called."""


JobEvent = LoopEvent | TrainStep | Progress | JobStarted | JobFinished | JobFailed | JobCancelled

JobEvents = Generator[JobEvent, bool | None, None]
"""A job at work. Closing it cancels it; a job that says so takes True and ends early with what it has."""
