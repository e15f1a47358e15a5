"""Without an optional dependency, one sentence says what needs it and how to install it."""

import json
import sys
import tomllib
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from nerfnav.core.errors import MissingExtraError
from nerfnav.core.extras import import_extra, installed_version
from nerfnav.experiments import planners
from nerfnav.experiments.figures import panels
from nerfnav.experiments.reflight import Setpoint, Track, fly_crazyflie, fly_quick
from nerfnav.export.recording import Recording
from nerfnav.export.ros_bags import mcap, rosbag2
from nerfnav.importers.captures.depths import stored_map
from nerfnav.importers.meshes.files import read_mesh
from nerfnav.planner.baselines.rrt import require_ompl
from nerfnav.robots.quadrotor import Quadrotor
from nerfnav.robots.state import Motion, RigidState

PROJECT = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())["project"]


def recording() -> Recording:
    """A robot that hovers for a step."""
    state, robot = RigidState.at_rest((0.0, 0.0, 1.0)), Quadrotor()
    return Recording.of_plan(Motion(RigidState.stack([state] * 2), torch.zeros(1, 4), 0.1), robot)


def collada(folder: Path) -> None:
    (folder / "house.dae").write_text("<COLLADA></COLLADA>")
    read_mesh(folder / "house.dae")


def draco(folder: Path) -> None:
    packed = {"KHR_draco_mesh_compression": {"bufferView": 0, "attributes": {"POSITION": 0}}}
    header = {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "extensions": packed}]}],
        "accessors": [{"componentType": 5126, "count": 3, "type": "VEC3"}],
    }
    (folder / "house.gltf").write_text(json.dumps(header))
    read_mesh(folder / "house.gltf")


def depth(name: str, folder: Path) -> None:
    (folder / name).write_bytes(b"packed")
    stored_map(folder / name, (1, 1), np.float32)


HOVER = Track(lambda _: Setpoint(np.zeros(3), np.zeros(3), np.zeros(3), 0.0, 0.0), 0.1)
_DEPTH = r"the depth of this capture \(--depth off learns from its pictures alone\)"
USES: dict[str, tuple[str, str, Callable[[Path], Any]]] = {
    "ompl": ("baselines", "the planner rrt", lambda _: require_ompl()),
    "matplotlib": ("experiments", "drawing a figure", lambda _: panels(("one",))),
    "lzfse": ("depth", _DEPTH, partial(depth, "0.depth")),
    "OpenEXR": ("depth", _DEPTH, partial(depth, "0.exr")),
    "mcap": ("ros", "MCAP", lambda _: mcap(recording())),
    "rosbags": ("ros", "rosbag2", lambda _: rosbag2(recording())),
    "rotorpy": ("reflight", "the experiment reflight", lambda _: fly_quick(HOVER, Quadrotor())),
    "drone_controllers": (
        "reflight",
        "the experiment reflight",
        lambda _: fly_crazyflie(HOVER, Quadrotor()),
    ),
    "collada": ("meshes", r"a Collada mesh \(.dae\)", collada),
    "DracoPy": ("meshes", "a mesh with Draco compression", draco),
}


@pytest.fixture
def hide(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """Makes every import of a package fail."""

    def hidden(package: str) -> None:
        for name in [name for name in sys.modules if name == package or name.startswith(f"{package}.")]:
            monkeypatch.delitem(sys.modules, name)
        monkeypatch.setitem(sys.modules, package, None)

    return hidden


@pytest.mark.parametrize("package", USES)
def test_what_needs_a_package_says_which_extra_brings_it(
    package: str, hide: Callable[[str], None], tmp_path: Path
) -> None:
    extra, user, use = USES[package]
    hide(package)
    sentence = rf"^{user} needs {package}, which is not installed here: pip install 'nerfnav\[{extra}\]'$"
    with pytest.raises(MissingExtraError, match=sentence):
        use(tmp_path)


@pytest.mark.parametrize("package", USES)
def test_the_extra_that_is_named_brings_the_package(package: str) -> None:
    listed = {"collada": "pycollada", "drone_controllers": "drone-controllers"}.get(package, package)
    brought = PROJECT["optional-dependencies"][USES[package][0]]
    assert any(entry.startswith((f"{listed}>", f"{listed}=")) for entry in brought)
    assert not [entry for entry in PROJECT["dependencies"] if entry.startswith(listed)]


def test_the_app_has_every_extra_that_it_offers() -> None:
    under_the_gpl = {"reflight"}  # cvxopt
    extras = {extra for extra, *_ in USES.values()} - under_the_gpl
    assert PROJECT["optional-dependencies"]["app"] == [f"nerfnav[{','.join(sorted(extras))}]"]


def test_planners_are_compared_without_the_one_that_is_missing(hide: Callable[[str], None]) -> None:
    assert planners.missing_planners() == {}
    hide("ompl")
    assert list(planners.missing_planners()) == ["rrt"]
    assert "pip install 'nerfnav[baselines]'" in planners.missing_planners()["rrt"]


def test_what_is_installed_is_given() -> None:
    assert import_extra("json", "none", "this test").dumps([]) == "[]"


def test_the_version_of_a_distribution_is_known_where_it_is_installed() -> None:
    assert installed_version("numpy") == np.__version__
    assert installed_version("no-such-distribution-anywhere") is None
