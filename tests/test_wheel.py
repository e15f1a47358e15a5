"""Wheel: every command works in an environment of its own, outside the repository.

The environment has the declared dependencies and no extras, so these tests also show that the declaration is complete.
"""

import json
import os
import subprocess
import tarfile
import time
import urllib.request
import zipfile
from base64 import b64encode
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import viser
import zstandard
from websockets.sync.client import connect

from tests.waiting import PATIENCE_S, free_port
from tests.wheel_environment import ROOT, build, install

pytestmark = [pytest.mark.slow, pytest.mark.timeout(1800)]

EXTRAS = ("ompl", "matplotlib", "mcap", "rosbags", "collada", "DracoPy", "pytest")
ZSTD = b"\x28\xb5\x2f\xfd"  # first bytes of a compressed frame


@dataclass(frozen=True)
class Installed:
    """A wheel in an environment."""

    wheel: Path
    sdist: Path
    commands: Path
    folder: Path
    """Empty, outside the repository."""

    def run(self, *words: str) -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            [str(self.commands / words[0]), *words[1:]],
            cwd=self.folder, env=self.environment, capture_output=True, text=True, timeout=900,
        )  # fmt: skip

    def numbers(self, *words: str) -> dict[str, Any]:
        """Return the JSON that a command prints with --json."""
        done = self.run("nerfnav", *words, "--json")
        assert done.returncode == 0, done.stderr
        return json.loads(done.stdout.splitlines()[-1])

    @property
    def environment(self) -> dict[str, str]:
        """Environment variables without those that lead to the repository; equal kernels share one cache."""
        return {name: value for name, value in os.environ.items() if not name.startswith(("PYTHON", "NERFNAV"))}


@pytest.fixture(scope="module")
def installed(tmp_path_factory: pytest.TempPathFactory) -> Installed:
    folder = tmp_path_factory.mktemp("wheel")
    wheel, sdist = build(folder)
    commands = install(wheel, folder / "environment")
    (folder / "empty").mkdir()
    return Installed(wheel, sdist, commands, folder / "empty")


def shipped() -> set[str]:
    """Return every file of the packages, as git lists them."""
    folders = {"nerfnav_app": ROOT / "app", "nerfnav": ROOT / "nerfnav", "nerfnav_scenes": ROOT / "scenes"}
    return {
        f"{package}/{path.relative_to(folder)}"
        for package, folder in folders.items()
        for path in folder.rglob("*")
        if path.is_file() and "__pycache__" not in path.parts
    }


def test_wheel_and_sdist_hold_every_file_of_the_packages(installed: Installed) -> None:
    with zipfile.ZipFile(installed.wheel) as wheel, tarfile.open(installed.sdist) as sdist:
        in_wheel = {name for name in wheel.namelist() if ".dist-info/" not in name}
        in_sdist = {name.partition("/")[2] for name in sdist.getnames()}
    assert in_wheel == shipped()
    assert shipped() <= {name.removeprefix("packaging/") for name in in_sdist}


def test_it_is_the_wheel_that_is_imported_and_no_extra_is_there(installed: Installed) -> None:
    script = (
        "import importlib.util, json, nerfnav, nerfnav_app as app, nerfnav_scenes as scenes\n"
        f"extras = [name for name in {EXTRAS} if importlib.util.find_spec(name)]\n"
        "print(json.dumps([nerfnav.__version__, nerfnav.__file__, app.__file__, scenes.__file__, extras]))"
    )
    version, *files, extras = json.loads(installed.run("python", "-c", script).stdout)
    assert all(Path(file).is_relative_to(installed.commands.parent) for file in files)
    assert extras == []
    assert installed.run("nerfnav", "--version").stdout == f"nerfnav {version}\n"


def test_a_plan_a_flight_and_their_exports(installed: Installed) -> None:
    planned = installed.numbers("plan", "stonehenge", "--out", "plan")
    assert (planned["outcome"], planned["mesh_overlap_m3"]) == ("converged", 0)
    flown = installed.numbers("fly", "stonehenge", "--task", "10", "--seed", "0", "--out", "flight")
    assert flown["outcome"] == "reached"
    for run, form, file in (("plan", "px4", "plan.csv"), ("flight", "html", "flight.html")):
        assert installed.numbers("export", run, "--format", form, "--out", file)["file_bytes"] > 1000
    refused = installed.run("nerfnav", "export", "plan", "--format", "mcap", "--out", "plan.mcap")
    assert refused.returncode != 0 and "pip install 'nerfnav[ros]'" in refused.stderr


def test_info_reads_a_field_file(installed: Installed) -> None:
    assert installed.numbers("info", str(ROOT / "scenes" / "trained" / "stonehenge.npz"))


def test_an_experiment_reports_what_it_leaves_out(installed: Installed) -> None:
    found = installed.numbers("experiment", "planners", "--trials", "1", "--out", "planners")
    assert found["nerfnav"]["failures"] == 0
    assert set(found["left_out"]) == {"rrt", "figures"}
    assert (installed.folder / "planners" / "results.json").is_file()


@pytest.mark.nightly  # two minutes; the bench's parts have their own tests
def test_a_quick_bench(installed: Installed) -> None:
    assert installed.numbers("bench", "--quick")["plan"]["ratio"] > 1


def test_the_page_has_its_name_its_logo_and_its_icons(installed: Installed) -> None:
    with served(installed) as url:
        with urllib.request.urlopen(url, timeout=PATIENCE_S) as answer:
            page = answer.read()
        assert b"<title>nerfnav</title>" in page
        assert data_url("favicon.svg") in page
        logo, icons = data_url("logo.svg"), b"icon-tabler"
        received = receive_until(url, (logo, icons))
    assert logo in received and icons in received


@contextmanager
def served(installed: Installed) -> Iterator[str]:
    """Yield the address of a server that runs during the block."""
    command = [str(installed.commands / "nerfnav"), "serve", "--port", str(free_port()), "--json"]
    with (installed.folder / "log").open("w") as log, subprocess.Popen(
        command, cwd=installed.folder, env=installed.environment, stdout=subprocess.PIPE, stderr=log, text=True
    ) as server:
        try:
            assert server.stdout is not None
            line = server.stdout.readline()
            assert line, (installed.folder / "log").read_text()
            yield json.loads(line)["url"]
        finally:
            server.terminate()  # not SIGINT, which background processes ignore
            try:
                server.wait(PATIENCE_S)
            except subprocess.TimeoutExpired:
                server.kill()
                raise
    assert "Traceback" not in (installed.folder / "log").read_text()


def receive_until(url: str, wanted: tuple[bytes, ...], timeout_s: float = 300.0) -> bytes:
    """Return all that a page receives over its websocket until that holds everything wanted."""
    received, end = b"", time.monotonic() + timeout_s
    protocol: Any = [f"viser-v{viser.__version__}"]
    address = url.replace("http", "ws", 1)
    with connect(address, subprotocols=protocol, compression=None, max_size=None) as page:
        while not all(word in received for word in wanted) and time.monotonic() < end:
            try:
                frame = page.recv(timeout=end - time.monotonic())
            except TimeoutError:
                break
            assert isinstance(frame, bytes)
            at = frame.find(ZSTD)
            received += zstandard.ZstdDecompressor().decompressobj().decompress(frame[at:]) if at >= 0 else frame
    return received


def data_url(picture: str) -> bytes:
    """Return the data URL by which the page has a picture."""
    return b"data:image/svg+xml;base64," + b64encode((ROOT / "app" / "page" / picture).read_bytes())
