"""What makes the first sight of the page come early, and keeps what runs long small."""

import gc
import json
import os
import signal
import subprocess
import sys
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import trimesh
import viser
from viser import _icons

from nerfnav.core.glb import parts
from nerfnav.core.kernel_cache import complete_mark
from nerfnav_app.cli.commands.serve import shown_before
from nerfnav_app.jobs.events import JobResult
from nerfnav_app.jobs.export.surface import build_first_surface, build_surface
from nerfnav_app.page.page import icons_at_hand
from nerfnav_app.places.place import open_place
from nerfnav_app.places.surface_glb import read_box
from nerfnav_app.state.job import JobKind
from nerfnav_app.system import compiling_kernels, give_back, importing
from nerfnav_app.worker import worker
from tests.app.doubles import ScriptedWork
from tests.app.worker.test_worker import Loop

_SLOW = (
    "trimesh", "numba", "scipy.spatial", "scipy.sparse", "scipy.special", "skimage", "rosbags", "matplotlib",
    "networkx", "PIL",
)  # fmt: skip
_AUTOLOAD = "TORCH_DEVICE_BACKEND_AUTOLOAD"
_OPENED = """
import json, sys
import nerfnav_app.server
from nerfnav_app.jobs.export.surface import build_surface
from nerfnav_app.places.place import open_place
place = open_place("stonehenge")
assert place.tasks and build_surface(place)
print(json.dumps(sorted(sys.modules)))
"""


_SHOWN = """
import sys
from pathlib import Path
from nerfnav_app.jobs.events import SurfaceShaped
from nerfnav_app.jobs.open import make_field
steps = make_field.run(Path(sys.argv[1]), Path(sys.argv[2]))
assert any(isinstance(event, SurfaceShaped) for event in steps)
assert "numba" not in sys.modules and "nerfnav_app.jobs.field.baked" not in sys.modules
"""


def test_the_command_limits_numpys_threads_before_numpy_is_imported() -> None:
    code = "import sys, nerfnav_app.cli.main; sys.exit('numpy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], timeout=300).returncode == 0


@pytest.mark.parametrize(("cores", "compiled", "writable", "begins"), [
    (2, False, True, True), (2, True, True, False), (1, False, True, False), (2, False, False, False),
])  # fmt: skip
def test_kernels_are_compiled_in_another_process_where_that_helps_until_the_app_ends(
    cores: int, compiled: bool, writable: bool, begins: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("nerfnav.core.jit.count_cores", lambda: cores)
    root = tmp_path if writable else Path(__file__)  # a file, in which there is no folder
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(root))
    if compiled:
        complete_mark().parent.mkdir(parents=True)
        complete_mark().touch()
    started: list[subprocess.Popen[bytes]] = []

    class Started(subprocess.Popen[bytes]):
        def __init__(self, *arguments: Any, **options: Any) -> None:
            super().__init__(*arguments, **options)
            started.append(self)

    monkeypatch.setattr(subprocess, "Popen", Started)
    with compiling_kernels():
        assert [process.poll() for process in started] == [None] * begins
    assert [process.returncode for process in started] == [-signal.SIGTERM] * begins


@pytest.mark.slow
def test_where_kernels_cannot_be_kept_compiling_them_ahead_is_refused_in_one_sentence() -> None:
    nowhere = os.environ | {"NUMBA_CACHE_DIR": str(Path(__file__))}  # a file, in which there is no folder
    done = subprocess.run(
        [sys.executable, "-m", "nerfnav_app.kernels_ahead"], env=nowhere, capture_output=True, text=True, timeout=300
    )
    (sentence,) = done.stderr.splitlines()
    assert done.returncode == 1 and sentence.startswith("nerfnav: ") and "set NUMBA_CACHE_DIR" in sentence


_FLOWN = """
from nerfnav.core.jit import report_compilation
from nerfnav.core.steps import run_steps
from nerfnav_app.jobs.fly.fly import run
from nerfnav_app.jobs.fly.request import FlyRequest
from nerfnav_app.jobs.plan.plan import PlanRequest
from nerfnav_app.places.ends import Ends
from nerfnav_app.places.place import open_place
place, reports = open_place("stonehenge"), []
with report_compilation(reports.append):
    run_steps(run(FlyRequest(PlanRequest(Ends.of_task(place.tasks[-1])), seed=3), place))
assert reports == [], f"{len(reports)} reports of compilations"
"""


@pytest.mark.nightly
def test_where_kernels_were_compiled_ahead_a_plan_and_a_flight_compile_none(tmp_path: Path) -> None:
    kept = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path), "OMP_NUM_THREADS": "1"}
    for what in (["-m", "nerfnav_app.kernels_ahead"], ["-c", _FLOWN]):
        subprocess.run([sys.executable, *what], env=kept, check=True, timeout=900)


@pytest.mark.slow
def test_a_place_is_opened_and_shown_before_anything_slow_is_imported_but_torch() -> None:
    for _ in range(2):  # the first time may have to make what is kept
        told = subprocess.run([sys.executable, "-c", _OPENED], capture_output=True, text=True, timeout=300)
        assert told.returncode == 0, told.stderr
    imported = set(json.loads(told.stdout))
    assert "torch" in imported and not imported & set(_SLOW)


@pytest.mark.slow
def test_a_mesh_is_shown_before_kernels_are_loaded(tmp_path: Path) -> None:
    mesh = tmp_path / "ball.ply"
    trimesh.creation.icosphere(subdivisions=2).export(mesh)
    words = [sys.executable, "-c", _SHOWN, str(mesh), str(tmp_path / "field.npz")]
    shown = subprocess.run(words, capture_output=True, text=True, timeout=300)
    assert shown.returncode == 0, shown.stderr


def _counted(function: Callable[..., None], calls: list[int]) -> Callable[..., None]:
    return lambda *arguments: (calls.append(1), function(*arguments))[1]


def test_icons_are_the_same_out_of_one_open_archive(monkeypatch: pytest.MonkeyPatch) -> None:
    names = (viser.Icon.MAP_2, viser.Icon.DRONE)
    known = [_icons.svg_from_icon.__wrapped__(name) for name in names]
    listed: list[int] = []
    monkeypatch.setattr(zipfile.ZipFile, "_RealGetContents", _counted(zipfile.ZipFile._RealGetContents, listed))  # type: ignore[attr-defined]
    with icons_at_hand():
        assert [_icons.svg_from_icon.__wrapped__(name) for name in names] == known
    assert len(listed) == 1, "the archive is listed once"
    assert [_icons.svg_from_icon.__wrapped__(name) for name in names] == known
    assert len(listed) == 3, "and afterwards as viser does it"


def test_nothing_is_collected_while_importing_and_again_afterwards_even_after_a_failure() -> None:
    with importing():
        assert not gc.isenabled()
    assert gc.isenabled()
    with pytest.raises(ImportError), importing():
        raise ImportError
    assert gc.isenabled()


@pytest.mark.parametrize(("asked", "found"), [(None, "0"), ("1", "1")])
def test_no_package_is_asked_for_devices_while_importing_unless_the_user_has_one_that_brings_some(
    asked: str | None, found: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(_AUTOLOAD, asked or "")
    if asked is None:
        monkeypatch.delenv(_AUTOLOAD)
    with importing():
        assert os.environ[_AUTOLOAD] == found


def test_what_is_there_after_importing_for_good_is_left_alone_by_collections() -> None:
    try:
        with importing(for_good=True):
            pass
        assert gc.get_freeze_count() > 0
    finally:
        gc.unfreeze()


def test_free_memory_can_be_given_back_at_any_time() -> None:
    give_back()


def test_memory_is_given_back_after_each_job(monkeypatch: pytest.MonkeyPatch) -> None:
    given: list[None] = []
    monkeypatch.setattr(worker, "give_back", lambda: given.append(None))
    loop = Loop(ScriptedWork({JobKind.OPEN: [JobResult()]}))
    loop.until(lambda: loop.session.job is None)
    loop.until(lambda: len(given) == 1)
    loop.worker.stop()


@pytest.mark.slow
def test_a_surface_that_was_shaped_is_found_by_the_name_or_the_file_of_its_place(
    field_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert shown_before(str(field_file)) is None, "nobody has looked at it on this machine"
    surface = build_surface(open_place(str(field_file)))
    assert shown_before(str(field_file)) == surface and read_box(surface) is not None
    assert shown_before("stonehenge") is None
    surface = build_surface(open_place("stonehenge"))
    assert shown_before("stonehenge") == surface
    assert shown_before("nowhere") is None


@pytest.mark.slow
def test_what_is_shown_before_there_is_a_texture_has_the_colours_of_all_its_vertices(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    place = open_place("stonehenge")
    first, rough = build_first_surface(place)
    textured = build_surface(place)
    assert rough and build_first_surface(place) == (textured, False)
    assert _faces(first) > 5 * _faces(textured), "colours of few vertices would be smeared over large faces"
    assert "COLOR_0" in parts(first)[0]["meshes"][0]["primitives"][0]["attributes"]


def _faces(glb: bytes) -> int:
    document = parts(glb)[0]
    return document["accessors"][document["meshes"][0]["primitives"][0]["indices"]]["count"] // 3
