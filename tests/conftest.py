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


_LONG = ("tests/browser/", "tests/test_wheel.py::")
"""What takes one process minutes, and begins first, so that no other has to wait for it in the end."""


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: not item.nodeid.startswith(_LONG))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """With several processes, all browser tests go to one: they have one browser, and it wants a core of its own.

    All others go by file, with what a file's tests share. Without browser tests, neighbours stay in one process until
    another one has nothing left to do.
    """
    from xdist.scheduler import LoadFileScheduling, WorkStealingScheduling

    if "not browser" in (config.getoption("markexpr") or ""):
        return WorkStealingScheduling(config, log)

    class OneBrowser(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return "tests/browser" if nodeid.startswith("tests/browser/") else super()._split_scope(nodeid)

    config.option.loadscopereorder = False  # by how many tests there are: few may take long
    return OneBrowser(config, log)
