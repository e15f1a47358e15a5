"""Faces: all names of `import nerfnav` and its packages exist, and none is imported before its first use."""

import subprocess
import sys
import tomllib
from importlib import import_module
from pathlib import Path

import pytest

import nerfnav
from tests.test_imports import FACES, on_the_face, package_path

ROOT = Path(__file__).parents[1]
HEAVY = ("torch", "numpy", "numba", "jaxtyping", "trimesh", "scipy", "cv2", "skimage", "viser", "matplotlib", "ompl")


def test_the_front_imports_nothing_heavy() -> None:
    script = f"import sys, nerfnav; dir(nerfnav); print(*[name for name in {HEAVY} if name in sys.modules])"
    ran = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=300)
    assert ran.stdout.split() == []


@pytest.mark.parametrize("stub", FACES, ids=lambda stub: str(stub.parent.relative_to(ROOT)))
def test_every_name_of_a_face_is_what_its_module_has(stub: Path) -> None:
    face = import_module(package_path(stub))
    for (module, name), package in on_the_face(stub).items():
        assert getattr(face, name) is getattr(import_module(module), name), f"{package} gives another {name}"
        assert name in dir(face)


@pytest.mark.slow
def test_planning_imports_no_mesh_library() -> None:
    script = "import sys, nerfnav; nerfnav.plan; print('trimesh' in sys.modules)"
    ran = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True, timeout=300)
    assert ran.stdout.split() == ["False"]


def test_an_unknown_name_raises_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match="No nerfnav attribute flyy"):
        _ = nerfnav.flyy  # type: ignore[attr-defined]


def test_packages_can_still_be_imported_from_it() -> None:
    from nerfnav import robots

    assert robots.names()


def test_the_version_is_defined_once() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    assert project["project"]["dynamic"] == ["version"]
    assert project["tool"]["setuptools"]["dynamic"]["version"] == {"attr": "nerfnav.__version__"}
    assert nerfnav.__version__.count(".") == 2


def test_types_are_shipped() -> None:
    assert (ROOT / "nerfnav" / "py.typed").is_file() and (ROOT / "scenes" / "py.typed").is_file()
