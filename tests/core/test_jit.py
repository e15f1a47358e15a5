"""How many threads kernels use, and that they may be made in any thread."""

import os
import re
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numba
import numpy as np
import pytest
import torch
from filelock import FileLock

from nerfnav.core.errors import InvalidInputError
from nerfnav.core.jit import (
    Kernel,
    _in_one_process,
    default_threads,
    kernel,
    prange,
    report_compilation,
    threads,
    use_threads,
)
from nerfnav.core.kernel_cache import KernelCacheWarning, cache_folder
from nerfnav.field.proof import carving

ROOT = Path(__file__).parents[2]


@kernel()
def _polynomial(x: float) -> float:
    total = 0.0
    for i in range(8):
        total += x**i / (1.0 + i * x)
    return total


def _sum_of_polynomials(values: np.ndarray) -> float:
    total = 0.0
    for value in values:
        total += _polynomial(value)
    return total


@pytest.mark.parametrize(("usable", "expected"), [({0}, 1), ({0, 1}, 1), ({1, 4, 5, 7}, 3)])
def test_one_of_the_cores_that_this_process_may_use_is_left_to_others(
    usable: set[int], expected: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: usable, raising=False)
    assert default_threads() == expected


@pytest.mark.parametrize(("count", "expected"), [(None, 4), (1, 1), (3, 3)])
def test_large_work_has_the_threads_that_it_is_given_and_plans_keep_one(
    count: int | None, expected: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {1, 4, 5, 7}, raising=False)
    with use_threads(count):
        assert default_threads() == expected
        with threads(1), threads(default_threads()) as used:
            assert used == 1
    assert default_threads() == 3


@pytest.mark.parametrize("count", [0, -1, 5])
def test_more_threads_than_cores_or_none_are_refused(count: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda process: {1, 4, 5, 7}, raising=False)
    with pytest.raises(InvalidInputError, match=f"threads must be .*, not {count}"), use_threads(count):
        pass


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
    assert Path(located._cache_path) == cache_folder() / "field_proof"
    elsewhere = Kernel(lambda x: x, {"cache": True})._dispatcher._cache
    assert Path(elsewhere._cache_path).parent == cache_folder()
    assert Path(__file__).parent.name in Path(elsewhere._cache_path).name, "of others, numba keeps apart the folders"


_ONE_KERNEL = """
import sys, numpy as np
from nerfnav.geometry.linear import multiply
sys.stdout.write("ready\\n"); sys.stdout.flush(); sys.stdin.readline()
multiply(np.eye(3), np.eye(3), np.empty((3, 3)))
print(sum(multiply._dispatcher.stats.cache_hits.values()))
"""


def test_of_two_processes_that_need_a_kernel_one_compiles_it_and_the_other_reads_it(tmp_path: Path) -> None:
    both = [
        subprocess.Popen(
            [sys.executable, "-c", _ONE_KERNEL], env={**os.environ, "NUMBA_CACHE_DIR": str(tmp_path)}, text=True,
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, cwd=ROOT,
        )
        for _ in range(2)
    ]  # fmt: skip
    for process in both:
        assert process.stdout is not None and process.stdout.readline() == "ready\n"
    for process in both:  # once both are there
        assert process.stdin is not None
        process.stdin.write("go\n")
        process.stdin.flush()
    assert sorted(int(process.communicate(timeout=100)[0]) for process in both) == [0, 1]


def test_a_process_that_waits_for_another_reports_that_and_then_goes_on(tmp_path: Path) -> None:
    path, reports = tmp_path / "kernel.lock", []
    other, waiting = FileLock(path), threading.Event()

    def report(compiles: bool) -> None:
        reports.append(compiles)
        waiting.set()

    def first_call() -> str:
        with report_compilation(report):
            return _in_one_process(lambda signature: f"{signature} after {reports}", path)("f8")

    with ThreadPoolExecutor() as pool, other:
        result = pool.submit(first_call)
        assert waiting.wait(60) and not result.done() and reports == [True]
        other.release()
        assert result.result(60) == "f8 after [True, False]"


def test_where_the_cache_cannot_be_written_kernels_are_compiled_all_the_same(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "file").write_text("no folder")
    assert _in_one_process(lambda signature: signature, tmp_path / "file" / "kernel.lock")("f8") == "f8"
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "file"))
    with pytest.warns(KernelCacheWarning, match="cannot be written.*set NUMBA_CACHE_DIR") as warned:
        for _ in range(2):
            new = Kernel(squares._function, squares._options)
            np.testing.assert_array_equal(new(np.arange(3.0)), [0.0, 1.0, 4.0])
    assert len(warned) == 1


def test_kernels_use_one_thread_unless_a_block_asks_for_more_and_none_inside_another_gets_more_than_that() -> None:
    torch_before = torch.get_num_threads()
    with threads(1) as outer, threads(4) as inner:
        assert (outer, inner) == (1, 1)
    with threads(2) as wide, threads(1) as narrow:
        assert wide == min(2, numba.config.NUMBA_NUM_THREADS) and narrow == 1  # type: ignore[attr-defined]
    assert torch.get_num_threads() == torch_before


@kernel(parallel=True)
def squares(values):
    """Each value's square."""
    out = np.empty_like(values)
    for i in prange(len(values)):
        out[i] = values[i] * values[i]
    return out


def test_a_parallel_kernel_gives_the_same_in_one_thread_and_in_several() -> None:
    values = np.arange(1000.0)
    alone = squares(values)
    with threads(2) as used:
        together = squares(values)
    assert used == min(2, numba.config.NUMBA_NUM_THREADS)  # type: ignore[attr-defined]
    np.testing.assert_array_equal(alone, values**2)
    np.testing.assert_array_equal(together, values**2)


@pytest.mark.slow
@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="the system does not tell how long threads computed")
def test_plans_and_updates_wake_up_no_pool_of_threads() -> None:
    """Neither OpenMP's nor that of a library for linear algebra: none has computed for long once the loop has run."""
    script = (
        "import nerfnav, torch\n"
        "torch.set_num_threads(1)\n"
        "import os\n"
        "from tests.planner.objective.test_objective import room, ROBOT, START, GOAL\n"
        "from nerfnav.core.steps import run_steps\n"
        "from nerfnav.planner.solvers.fast import plan_fast\n"
        "from nerfnav.planner.objective.problem import PlanProblem\n"
        "from nerfnav.estimator.gauss_newton.fast_filter import FastFilter\n"
        "from nerfnav.estimator.core.belief import Belief\n"
        "from nerfnav.robots.noise import StateNoise\n"
        "from nerfnav.field.render.volume_rendering import render_image\n"
        "from nerfnav.geometry.camera import FORWARD_MOUNT, Camera\n"
        "camera, field = Camera.from_fov(40, 40, 90), room()\n"
        "picture = render_image(field, camera, START.pose.compose(FORWARD_MOUNT)).image\n"
        "for _ in range(2):\n"
        "    plan = run_steps(plan_fast(PlanProblem(field, ROBOT, START, GOAL)))\n"
        "    belief = Belief(START, StateNoise().covariance())\n"
        "    [*FastFilter(field, ROBOT, camera).correct(belief, picture, torch.Generator().manual_seed(0))]\n"
        "own = os.getpid()\n"
        "def ticks(task):\n"
        "    return sum(map(int, open(f'/proc/self/task/{task}/stat').read().rsplit(')', 1)[1].split()[11:13]))\n"
        "others = [ticks(task) for task in os.listdir('/proc/self/task') if int(task) != own]\n"
        "print(max(others, default=0), ticks(own))\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, cwd=ROOT)
    others, own = map(int, done.stdout.split()[-2:])
    # one that is woken up and spins computes as long as the loop itself
    assert others <= 0.1 * own, f"another thread computed for {others} ticks of {own}"


def test_compilation_is_reported_once_for_a_kernel_with_those_that_it_calls_and_only_in_its_own_thread() -> None:
    reports: list[bool] = []
    inner = Kernel(lambda x: x + 1, {})

    def outer(x: float) -> float:
        return inner(x) + 1

    with report_compilation(reports.append):
        assert Kernel(outer, {})(1.0) == 3.0
        assert reports == [True, False]
        with ThreadPoolExecutor(1) as pool:
            assert pool.submit(Kernel(lambda x: x + 2, {}), 1.0).result() == 3.0
    Kernel(lambda x: x + 3, {})(1.0)
    assert reports == [True, False]


def test_reading_machine_code_from_the_cache_is_no_compilation() -> None:
    reports: list[bool] = []
    squares(np.arange(3.0))
    with report_compilation(reports.append):
        np.testing.assert_array_equal(Kernel(squares._function, squares._options)(np.arange(3.0)), [0.0, 1.0, 4.0])
    assert reports == []


def test_a_kernel_that_another_one_calls_is_a_part_of_it() -> None:
    caller = Kernel(_sum_of_polynomials, {"cache": False})  # what is read from a cache cannot be looked at
    assert caller(np.ones(3)) > 0
    (code,) = caller._dispatcher.inspect_llvm().values()
    assert "PyArg_UnpackTuple" in code, "the code that Python calls"
    assert not re.findall(r"(?:define|call) [^\n]*@_ZN\w*11_polynomial", code)
    (part,) = _polynomial._inlined.overloads.values()
    assert part.library.get_pointer_to_function(part.fndesc.llvm_func_name) == 0, "it has no machine code of its own"


_PLAN = """
import numpy as np
import nerfnav
import nerfnav_scenes as scenes
scene = scenes.load("stonehenge")
field = nerfnav.load_field(scenes.trained_path("stonehenge"))
task = scene.tasks[10]
problem = nerfnav.PlanProblem(field, nerfnav.Quadrotor(), task.start_state, task.goal_state)
print(np.asarray(nerfnav.plan(problem).motion.actions).tobytes().hex())
"""


@pytest.mark.nightly
def test_a_plan_is_equal_to_the_bit_whether_its_kernels_are_compiled_or_read(tmp_path: Path) -> None:
    variables = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)}
    compiled, read = (
        subprocess.run([sys.executable, "-c", _PLAN], env=variables, cwd=ROOT, check=True, capture_output=True).stdout
        for _ in range(2)
    )
    assert compiled and compiled == read
