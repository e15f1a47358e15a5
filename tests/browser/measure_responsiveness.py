"""How quick the page and its buttons are while the app computes. Prints JSON.

    python -m tests.browser.measure_responsiveness --cores 0,1 --seconds 20

The app runs on the given cores, the browser on `--browser-cores` (the others by default). One number is the time from
a click to the callback of its button in the app's process, another the frames that the page draws each second, both
while nothing happens and while flights replan at full speed; the third is the time of a whole step of those flights:
action, picture, filter, plan, and what the page asks of the worker in between. Run it on a machine that does nothing
else.
"""

import argparse
import contextlib
import json
import os
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import msgspec
import numpy as np
import viser
from playwright.sync_api import sync_playwright
from websockets.exceptions import ConnectionClosed
from websockets.sync.client import ClientConnection, connect

from nerfnav_app.jobs.events import JobEvents
from nerfnav_app.state.job import Job
from nerfnav_app.state.session import Session
from tests.app.security.hostile import CAMERA
from tests.browser.conftest import launch
from tests.browser.tab import KNOWS_HELP
from tests.waiting import free_port

_FRAMES = """
seconds => new Promise(done => {
  let count = 0;
  const began = performance.now();
  const frame = now => (now - began > 1000 * seconds) ? done(1000 * count / (now - began))
                                                      : (count++, requestAnimationFrame(frame));
  requestAnimationFrame(frame);
})
"""
_DRAWN = """
() => {
  const camera = window.__viserMutable.cameraControl, frame = () => {
    camera.rotate(0.002, 0, false);
    requestAnimationFrame(frame);
  };
  requestAnimationFrame(frame);
}
"""
_PART_S = 5  # idle and busy in turns of this length: machines are not always as quick
_READY = "'/field' in (window.__viserSceneTree?.getState() ?? {}) && !!window.__viserMutable?.cameraControl"


def serve(port: int) -> None:
    """The app with one more button, which tells on stdout when it was pressed, and the steps of flights since then."""
    from nerfnav.navigation import NavigationStep
    from nerfnav_app.cli.commands.serve import _SWITCH_S
    from nerfnav_app.server import App
    from nerfnav_app.worker.backend import NavigationBackend

    steps_ms: list[float] = []

    class Timed(NavigationBackend):
        def begin(self, session: Session, job: Job) -> JobEvents:
            """The job, with the times from step to step of a flight."""
            events, last = super().begin(session, job), None
            while True:
                try:
                    event = next(events)
                except StopIteration as end:
                    return end.value
                if isinstance(event, NavigationStep):
                    now = time.monotonic()
                    if last is not None:
                        steps_ms.append(1000 * (now - last))
                    last = now
                yield event

    sys.setswitchinterval(_SWITCH_S)
    app = App("stonehenge", port=port, work=Timed())
    app.start()
    assert app._server is not None
    probe = app._server.gui.add_button("Probe", visible=False)

    @probe.on_click
    async def _(_: viser.GuiEvent) -> None:
        told, steps_ms[:] = list(steps_ms), []
        print(json.dumps({"at": time.monotonic(), "steps_ms": told}), flush=True)

    print(json.dumps({"uuid": probe._impl.uuid}), flush=True)
    app.wait()


@contextmanager
def app_on(cores: set[int], port: int) -> Iterator[subprocess.Popen[str]]:
    """The app as a process on these cores."""
    command = [sys.executable, "-m", "tests.browser.measure_responsiveness", "--serve", str(port)]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    os.sched_setaffinity(process.pid, cores)
    try:
        yield process
    finally:
        process.terminate()
        process.wait(30)


def pin_browser(cores: set[int]) -> None:
    """Keep all threads of this process's browser on these cores: those that draw choose others by themselves."""
    parents = {}
    for stat in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):  # it may have ended
            parents[int(stat.parent.name)] = int(stat.read_text().rsplit(")", 1)[1].split()[1])
    family = {os.getpid()}
    while grown := {child for child, parent in parents.items() if parent in family} - family:
        family |= grown
    for process in family:
        if "chromium" in Path(f"/proc/{process}/cmdline").read_text():
            for task in Path(f"/proc/{process}/task").iterdir():
                os.sched_setaffinity(int(task.name), cores)


def connected(port: int) -> ClientConnection:
    """A connection like that of a page, which takes in what it is sent."""
    connection = connect(f"ws://127.0.0.1:{port}/", subprotocols=[f"viser-v{viser.__version__}"], max_size=None)  # type: ignore[list-item]
    connection.send(msgspec.msgpack.encode(CAMERA))

    def drain() -> None:
        with contextlib.suppress(ConnectionClosed):
            for _ in connection:
                pass

    threading.Thread(target=drain, daemon=True).start()
    time.sleep(1)
    return connection


def click_often(
    process: subprocess.Popen[str], connection: ClientConnection, uuid: str, seconds: float, found: "Times"
) -> None:
    """Click some ten times each second, and note how long each took to come to its callback."""
    click = msgspec.msgpack.encode({"type": "GuiUpdateMessage", "uuid": uuid, "updates": {"value": True}})
    end = time.monotonic() + seconds
    assert process.stdout is not None
    while time.monotonic() < end:
        sent = time.monotonic()
        connection.send(click)
        told = json.loads(process.stdout.readline())
        found.clicks_ms.append(1000 * (told["at"] - sent))
        found.steps_ms += told["steps_ms"]
        time.sleep(0.1)


@dataclass
class Times:
    """What was measured while the app did one thing."""

    clicks_ms: list[float] = field(default_factory=list)
    """From clicks to their callbacks."""
    frames: list[float] = field(default_factory=list)
    """Frames each second."""
    steps_ms: list[float] = field(default_factory=list)
    """From step to step of flights."""

    def summary(self) -> dict[str, object]:
        """Percentiles of the times [ms], and the median of the frames each second."""
        found: dict[str, object] = {"click_ms": percentiles(self.clicks_ms)}
        found["frames_per_s"] = round(float(np.median(self.frames)), 1)
        return found | ({"step_ms": percentiles(self.steps_ms)} if self.steps_ms else {})


def percentiles(times_ms: list[float]) -> dict[str, float]:
    """The middle, the 95th of a hundred, the longest, and how many there are."""
    p50, p95, worst = (round(float(value), 1) for value in np.percentile(times_ms, [50, 95, 100]))
    return {"p50": p50, "p95": p95, "max": worst, "count": len(times_ms)}


def measure(cores: set[int], browser_cores: set[int], seconds: float) -> dict[str, object]:
    """Idle and busy in turns."""
    os.sched_setaffinity(0, browser_cores)
    port = free_port()
    with app_on(cores, port) as process, sync_playwright() as playwright:
        assert process.stdout is not None
        uuid = json.loads(process.stdout.readline())["uuid"]
        browser = launch(playwright)
        page = browser.new_page(viewport={"width": 640, "height": 480})
        page.add_init_script(KNOWS_HELP)
        page.goto(f"http://127.0.0.1:{port}/?fixedDpr=0.5")
        page.wait_for_function(_READY, timeout=120_000)
        page.wait_for_timeout(8000)  # kernels are compiled
        pin_browser(browser_cores)
        page.evaluate(_DRAWN)  # the view turns, so that there is a frame to draw each time
        connection = connected(port)
        report: dict[str, object] = {"cores": sorted(cores), "browser_cores": sorted(browser_cores)}
        times = {"idle": Times(), "busy": Times()}
        for name in max(1, round(seconds / _PART_S)) * ["idle", "busy"]:
            page.keyboard.press("f" if name == "busy" else "x")
            page.wait_for_timeout(2000)
            clicker = threading.Thread(target=click_often, args=(process, connection, uuid, _PART_S, times[name]))
            clicker.start()
            end = time.monotonic() + _PART_S
            while time.monotonic() < end:
                if name == "busy":
                    page.keyboard.press("f")  # the next flight, where the last has ended
                times[name].frames.append(page.evaluate(_FRAMES, 2))
            clicker.join()
        report |= {name: measured.summary() for name, measured in times.items()}
        browser.close()
    return report


def main() -> None:
    """Measure, and print."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cores", default="0,1")
    parser.add_argument("--browser-cores", default=None)
    parser.add_argument("--seconds", type=float, default=20)
    parser.add_argument("--serve", type=int, default=None, help=argparse.SUPPRESS)
    asked = parser.parse_args()
    if asked.serve is not None:
        serve(asked.serve)
        return
    cores = {int(core) for core in asked.cores.split(",")}
    others = set(range(os.cpu_count() or 1)) - cores or cores
    browser_cores = {int(core) for core in asked.browser_cores.split(",")} if asked.browser_cores else others
    print(json.dumps(measure(cores, browser_cores, asked.seconds)))


if __name__ == "__main__":
    main()
