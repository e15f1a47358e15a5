"""What all tests share."""

# isort: off
from collections.abc import Iterator

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
