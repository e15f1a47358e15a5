"""What all tests share."""

# isort: off
from collections.abc import Iterator
from typing import Any

import pytest

import nerfnav  # noqa: F401  # before torch: it tells idle threads to sleep, which torch reads when it is loaded
import torch

# isort: on

# Tests are many small operations, often beside other busy processes: more threads only wait for each other.
torch.set_num_threads(1)


@pytest.fixture(autouse=True, scope="session")
def _own_shelf(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """A shelf for all tests: flights must not end up where the tests are started."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("NERFNAV_RUNS", str(tmp_path_factory.mktemp("shelf")))
        patch.setenv("NERFNAV_PLACES", str(tmp_path_factory.mktemp("places")))
        yield


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """With several processes, all browser tests go to one: they have one browser, and it wants a core of its own.

    Without them, neighbours stay in one process, with what they share, until another one has nothing left to do.
    """
    from xdist.scheduler import LoadScopeScheduling, WorkStealingScheduling

    if "not browser" in config.getoption("markexpr"):
        return WorkStealingScheduling(config, log)

    class OneBrowser(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return "tests/browser" if nodeid.startswith("tests/browser/") else nodeid

    return OneBrowser(config, log)
