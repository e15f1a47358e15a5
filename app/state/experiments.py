"""Experiments in the session, and the actions of a person on them."""

from dataclasses import dataclass, replace

MOST_TRIALS = 100
"""More are for the command line."""


@dataclass(frozen=True)
class StartExperiment:
    """Do an experiment."""

    name: str
    """Name of the experiment."""
    trials: int
    """How many."""


@dataclass(frozen=True)
class ShowResult:
    """Look at the results of an experiment."""

    name: str
    """Of the folder."""


@dataclass(frozen=True)
class ListExperiments:
    """Find out which experiments and results there are."""


ExperimentAction = StartExperiment | ShowResult | ListExperiments


@dataclass(frozen=True)
class ExperimentState:
    """Experiments, as the session knows them."""

    asked: StartExperiment | None = None
    """The last that was begun."""
    stamp: int = 0
    """Rises when there may be new results; 0 while nobody wants to know."""
    show: str | None = None
    """Folder of the results that are looked at."""

    def commanded(self, action: ExperimentAction) -> "ExperimentState":
        """After an action of the user."""
        match action:
            case StartExperiment():
                return replace(self, asked=action)
            case ShowResult(name):
                return replace(self, show=name)
            case ListExperiments():
                return replace(self, stamp=self.stamp + 1)

    def ended(self, folder: str) -> "ExperimentState":
        """After an experiment whose results lie in `folder`."""
        return replace(self, stamp=self.stamp + 1, show=folder)
