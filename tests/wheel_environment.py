"""Wheel environment: build a wheel, and install it with its declared dependencies and nothing else."""

import email
import shutil
import subprocess
import sys
import zipfile
from importlib.metadata import distribution
from pathlib import Path

from packaging.requirements import Requirement

ROOT = Path(__file__).parents[1]
PARTS = ("app", "nerfnav", "packaging", "scenes", "pyproject.toml", "README.md", "LICENSE")
"""Files and folders that the build needs."""


def build(folder: Path) -> tuple[Path, Path]:
    """Build the sdist of a fresh copy of the clone, and the wheel from that sdist; returns wheel and sdist."""
    source = folder / "source"
    source.mkdir()
    for part in PARTS:
        if (ROOT / part).is_dir():
            shutil.copytree(ROOT / part, source / part, symlinks=True, ignore=shutil.ignore_patterns("__pycache__"))
        else:
            shutil.copy2(ROOT / part, source / part)
    command = [sys.executable, "-m", "build", "--no-isolation", "--outdir", str(folder / "dist"), str(source)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stdout + done.stderr
    (wheel,), (sdist,) = (folder / "dist").glob("*.whl"), (folder / "dist").glob("*.tar.gz")
    return wheel, sdist


def install(wheel: Path, folder: Path) -> Path:
    """Make a new environment with the wheel, and return its folder of commands.

    The declared dependencies of the wheel without extras, and theirs in turn, are linked from the environment of the
    tests. pip then installs the wheel without an index, and fails where anything is missing.
    """
    subprocess.run([sys.executable, "-m", "venv", str(folder)], check=True, timeout=900)
    (site,) = folder.glob("lib/python*/site-packages")
    for name in closure(_requirements(wheel)):
        _link(name, site)
    pip = [str(folder / "bin" / "python"), "-m", "pip", "install", "--no-index", str(wheel)]
    done = subprocess.run(pip, capture_output=True, text=True, timeout=900)
    assert done.returncode == 0, done.stderr
    return folder / "bin"


def closure(requirements: list[str]) -> set[str]:
    """Return the names of all distributions that requirements need, without those of extras."""
    found: set[str] = set()
    waiting = list(requirements)
    while waiting:
        requirement = Requirement(waiting.pop())
        wanted = requirement.marker is None or requirement.marker.evaluate({"extra": ""})
        if wanted and requirement.name.lower() not in found:
            found.add(requirement.name.lower())
            waiting += distribution(requirement.name).requires or []
    return found


def _requirements(wheel: Path) -> list[str]:
    with zipfile.ZipFile(wheel) as content:
        (name,) = [name for name in content.namelist() if name.endswith(".dist-info/METADATA")]
        return email.message_from_bytes(content.read(name)).get_all("Requires-Dist") or []


def _link(name: str, site: Path) -> None:
    """Link all files of a distribution into a folder of packages."""
    there = distribution(name)
    for top in {file.parts[0] for file in there.files or []} - {"..", "__pycache__"}:
        if not (site / top).exists():
            (site / top).symlink_to(Path(str(there.locate_file(top))).absolute())
