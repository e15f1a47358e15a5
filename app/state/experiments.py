"""What the session holds of experiments. Nothing here touches the disk."""

from dataclasses import dataclass, field, replace

import numpy as np

MOST_TRIALS = 100
"""More are for the command line."""


@dataclass(frozen=True)
class StartTrials:
    """Do an experiment."""

    name: str
    """Which."""
    trials: int
    """How many."""


@dataclass(frozen=True)
class ShowResult:
    """Look at the results of an experiment."""

    name: str
    """Of the folder."""


@dataclass(frozen=True)
class ListTrials:
    """Find out which experiments and results there are."""


TrialsCommand = StartTrials | ShowResult | ListTrials


@dataclass(frozen=True)
class Result:
    """What came of an experiment."""

    name: str
    """Of its folder."""
    numbers: tuple[tuple[str, str], ...]
    """Its summary, as names and values."""
    figures: tuple[np.ndarray, ...] = field(compare=False)
    """(height, width, 3), sRGB bytes."""


@dataclass(frozen=True)
class TrialsQuestion:
    """Which experiments and results are there, and what is in one of the results?"""

    stamp: int
    """Rises when there may be new results."""
    show: str | None
    """Name of a folder of results."""


@dataclass(frozen=True)
class TrialsReport:
    """What is there."""

    question: TrialsQuestion
    known: tuple[tuple[str, str], ...] = field(default=(), compare=False)
    """Name and purpose of each experiment."""
    earlier: tuple[str, ...] = field(default=(), compare=False)
    """Folders of results, the newest first."""
    result: Result | None = field(default=None, compare=False)
    """What was asked for."""


@dataclass(frozen=True)
class Trials:
    """Experiments, as the session knows them."""

    asked: StartTrials | None = None
    """The last that was begun."""
    stamp: int = 0
    """Rises when there may be new results; 0 while nobody wants to know."""
    show: str | None = None
    """Folder of the results that are looked at."""
    report: TrialsReport | None = None
    """What is known."""

    @property
    def question(self) -> TrialsQuestion | None:
        """What is not known yet."""
        question = TrialsQuestion(self.stamp, self.show)
        if not self.stamp:
            return None
        return None if self.report is not None and self.report.question == question else question

    @property
    def names(self) -> tuple[str, ...]:
        """The experiments that there are."""
        return tuple(name for name, _ in self.report.known) if self.report is not None else ()

    @property
    def result(self) -> Result | None:
        """What is looked at."""
        return self.report.result if self.report is not None else None

    def commanded(self, command: TrialsCommand) -> "Trials":
        """After a command of the user."""
        match command:
            case StartTrials():
                return replace(self, asked=command)
            case ShowResult(name):
                return replace(self, show=name)
            case ListTrials():
                return replace(self, stamp=self.stamp + 1)

    def ended(self, folder: str) -> "Trials":
        """After an experiment whose results lie in `folder`."""
        return replace(self, stamp=self.stamp + 1, show=folder)
