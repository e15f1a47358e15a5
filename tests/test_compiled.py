"""How many threads kernels use, and that they may be made in any thread."""

import os
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numba
import pytest

from nerfnav.compiled import Kernel, default_threads
from nerfnav.field.kernels import carving
from nerfnav.kernel_cache import cache_folder


@pytest.mark.parametrize(("usable", "expected"), [({0}, 1), ({0, 1}, 1), ({1, 4, 5, 7}, 3)])
def test_one_of_the_cores_that_this_process_may_use_is_left_to_others(
    usable: set[int], expected: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: usable, raising=False)
    assert default_threads() == expected


def test_kernels_that_are_made_in_several_threads_at_once_are_all_kept_in_their_own_folder() -> None:
    before = numba.config.CACHE_DIR  # type: ignore[attr-defined]
    make = Kernel._dispatcher.func  # type: ignore[attr-defined]  # without the lock that Python 3.11 has around it
    kernels = [Kernel(lambda x, k=k: x + k, {"cache": True}) for k in range(60)]
    interval = sys.getswitchinterval()
    try:
        sys.setswitchinterval(1e-6)
        with ThreadPoolExecutor(8) as pool:
            made = list(pool.map(make, kernels))
    finally:
        sys.setswitchinterval(interval)
    assert before == numba.config.CACHE_DIR, "what others compile is kept where it was"  # type: ignore[attr-defined]
    assert all(str(cache_folder()) in one._cache._cache_path for one in made)


def test_machine_code_is_shared_by_all_installations_of_the_same_kernels() -> None:
    located = carving.look_through._dispatcher._cache
    assert Path(located._cache_path) == cache_folder() / "field_kernels"
    elsewhere = Kernel(lambda x: x, {"cache": True})._dispatcher._cache
    assert Path(elsewhere._cache_path).parent == cache_folder()
    assert Path(__file__).parent.name in Path(elsewhere._cache_path).name, "of others, numba keeps apart the folders"
