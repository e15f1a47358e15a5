"""The names that `import nerfnav` gives: all there, none imported before it is asked for."""

import ast
import subprocess
import sys
import tomllib
from importlib import import_module
from pathlib import Path

import pytest

import nerfnav

ROOT = Path(__file__).parents[1]
HEAVY = ("torch", "numpy", "numba", "jaxtyping", "trimesh", "scipy", "cv2", "skimage", "viser", "matplotlib", "ompl")


def test_the_front_imports_nothing_heavy() -> None:
    told = f"import sys, nerfnav; dir(nerfnav); print(*[name for name in {HEAVY} if name in sys.modules])"
    ran = subprocess.run([sys.executable, "-c", told], capture_output=True, text=True, check=True, timeout=60)
    assert ran.stdout.split() == []


@pytest.mark.parametrize("name", nerfnav._HOMES)
def test_a_name_is_what_its_module_has(name: str) -> None:
    assert getattr(nerfnav, name) is getattr(import_module(nerfnav._HOMES[name]), name)
    assert name in dir(nerfnav)


def test_type_checkers_see_the_same_names_from_the_same_modules() -> None:
    tree = ast.parse((ROOT / "nerfnav" / "__init__.py").read_text())
    (seen,) = [node for node in tree.body if isinstance(node, ast.If)]
    imports = [node for node in seen.body if isinstance(node, ast.ImportFrom)]
    assert {alias.asname: node.module for node in imports for alias in node.names} == nerfnav._HOMES


def test_a_name_that_there_is_not_is_refused() -> None:
    with pytest.raises(AttributeError, match="module 'nerfnav' has no attribute 'flyy'"):
        _ = nerfnav.flyy  # type: ignore[attr-defined]


def test_packages_can_still_be_imported_from_it() -> None:
    from nerfnav import robots

    assert robots.names()


def test_the_version_is_said_once() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    assert project["project"]["dynamic"] == ["version"]
    assert project["tool"]["setuptools"]["dynamic"]["version"] == {"attr": "nerfnav.__version__"}
    assert nerfnav.__version__.count(".") == 2


def test_types_are_shipped() -> None:
    assert (ROOT / "nerfnav" / "py.typed").is_file() and (ROOT / "scenes" / "py.typed").is_file()
