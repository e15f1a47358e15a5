"""Fixtures and scheduling of all tests."""

# isort: off
import gc
import os
from collections.abc import Iterator
from typing import Any

import pytest

import nerfnav  # noqa: F401  # before torch: it sets OMP_WAIT_POLICY, which torch reads when it is loaded
import torch

# isort: on

from threadpoolctl import threadpool_limits

from nerfnav.core.kernel_cache import cache_folder
from tests.shape_checks import begin_test

# Tests are many small operations, often beside other busy processes: more threads only wait for each other.
torch.set_num_threads(1)
# As in the command (use_one_blas_thread): else numpy's sums, and plans, depend on the number of cores. Plugins of
# pytest have loaded numpy before, so that its environment variable comes too late.
threadpool_limits(1, user_api="blas")


@pytest.fixture(autouse=True, scope="session")
def _own_shelf(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep flights and places of the tests in temporary folders, not in the working folder.

    Compiled kernels stay where they are, for tests that move the user's cache too: to compile them takes 100 s.
    """
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("NUMBA_CACHE_DIR", str(cache_folder().parents[1]))
        patch.setenv("NERFNAV_RUNS", str(tmp_path_factory.mktemp("shelf")))
        patch.setenv("NERFNAV_PLACES", str(tmp_path_factory.mktemp("places")))
        yield


def pytest_runtest_setup() -> None:
    """Check types and shapes of the first calls of each function in the test."""
    begin_test()


_LONG = ("tests/browser/", "tests/test_wheel.py::")
"""Tests that take minutes in one process. They start first, so that no process waits for them at the end."""


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    items.sort(key=lambda item: not item.nodeid.startswith(_LONG))


def pytest_collection_finish() -> None:
    """Look for garbage less often, and not among what was imported: a twentieth of the time of the tests."""
    gc.collect()
    gc.freeze()
    gc.set_threshold(50_000, 20, 20)


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int | None:
    """With `-n auto`, two processes more than cores: that of the browser tests waits for the browser most of the time,
    others wait for commands that they start, and for timers."""
    return None if "PYTEST_XDIST_AUTO_NUM_WORKERS" in os.environ else 2 + len(os.sched_getaffinity(0))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Run all browser tests in one process: they share one browser, which needs a core of its own.

    Schedule the others by file, as tests of one file share fixtures. Without browser tests, schedule by work stealing.
    """
    from xdist.scheduler import LoadFileScheduling, WorkStealingScheduling

    if "not browser" in (config.getoption("markexpr") or ""):
        return WorkStealingScheduling(config, log)

    class OneBrowser(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return "tests/browser" if nodeid.startswith("tests/browser/") else super()._split_scope(nodeid)

    config.option.loadscopereorder = False  # else files with few tests come last, though these may take long
    return OneBrowser(config, log)
