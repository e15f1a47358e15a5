"""How many threads kernels use."""

import os

import pytest

from nerfnav.compiled import default_threads


@pytest.mark.parametrize(("usable", "expected"), [({0}, 1), ({0, 1}, 1), ({1, 4, 5, 7}, 3)])
def test_one_of_the_cores_that_this_process_may_use_is_left_to_others(
    usable: set[int], expected: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: usable, raising=False)
    assert default_threads() == expected
