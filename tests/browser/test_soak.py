"""A long time of hard use: five tabs, flights that replan, random drags, clicks, keys and reloads.

Two minutes of it are a test. Half an hour, with its numbers as JSON, the server's log in soak.log:

    python -m tests.browser.test_soak --minutes 30 --log soak.log
"""

import argparse
import json
import math
import os
import random
import re
import sys
import tempfile
import time
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, BrowserContext, Error, Locator, sync_playwright

import nerfnav_scenes as scenes
from nerfnav_app.page.layers.ends import GIZMO
from nerfnav_app.places.ends import EndRole
from tests.browser.complaints import complaints_of
from tests.browser.conftest import launch
from tests.browser.process import Served, done, served
from tests.browser.tab import Tab
from tests.waiting import PATIENCE_S

TABS = 5
WARM_UP_S = 300.0
"""Until then memory may grow as it likes."""
MOST_GROWTH_MB = 50.0
"""From then on."""
MOST_OF_PLACES_MB = 150.0
"""In a round through all bundled places, which take 750 together."""
LEAST_ACTIONS = 20
"""Fewer are no hard use: a slow machine takes longer for them."""
_WINDOW_S = 300.0
_KEYS = ("f", "f", "f", "p", "t", "g", "s", "Space", "x")
_LEFT_OUT = (
    *("Upload", "Open a file", "Delete", "Reopen", "Rename", "Save", "Reset"),  # which ask, or touch what is kept
    *(f"Open {place}" for place in scenes.names()),  # what is kept of one more place is no leak, but looks like one
)
_BEGINS = re.compile(r"Plan trajectory|Fly|Fly anyway|Allow [\d.]+ s|Restore the weights")
"""What the main button offers while nothing runs."""
_READY = """
() => ['/start', '/goal'].every(name => name in (window.__viserSceneTree?.getState() ?? {})
  && window.__viserMutable?.nodePoseData?.[name]) && !!window.__viserMutable.canvas
"""
_AT_REST_S = 0.1
"""What a server that does nothing may compute in a second [s]."""
_IS_OPEN = """
place => [...document.querySelectorAll('input')].some(input => input.value === place)
  && !document.body.innerText.includes('Opening')
"""
_SEEN = "found => found.filter(button => button.checkVisibility()).map(button => button.innerText.trim())"
_WENT_AWAY = ("Timeout", "not visible", "outside of the viewport", "not attached")
"""What Playwright says of a button that went away under the mouse, which is no fault."""


@dataclass
class Account:
    """What happened."""

    actions: dict[str, int] = field(default_factory=dict)
    """How often each was done."""
    memory_mb: list[tuple[float, float]] = field(default_factory=list)
    """Seconds since the start, and the server's memory."""
    complaints: list[str] = field(default_factory=list)
    """Of pages and of the server's log."""
    idle: bool = False
    """Whether at the end nothing was running any more."""

    def growth_mb(self, since_s: float) -> float:
        """How much the largest memory after `since_s` is above that at `since_s` [MB]."""
        late = [memory for at, memory in self.memory_mb if at >= since_s]
        return max(late) - late[0] if late else 0.0

    def kept_mb(self, since_s: float, window_s: float = _WINDOW_S) -> float:
        """How much the least memory of the last `window_s` is above that of as long a time after `since_s` [MB]."""
        end = self.memory_mb[-1][0]
        early = [memory for at, memory in self.memory_mb if since_s <= at <= since_s + window_s]
        late = [memory for at, memory in self.memory_mb if at >= max(since_s, end - window_s)]
        return min(late) - min(early) if early and late else 0.0


def compile_kernels() -> None:
    """Of all kinds of robots, in other processes: where it has to work, the compiler keeps hundreds of megabytes."""
    for place, robot in (("stonehenge", "quadrotor"), ("stonehenge", "diffdrive"), ("church", "couch")):
        first = next(index for index, task in enumerate(scenes.tasks_of(place)) if task.robot == robot)
        done("fly", place, "--task", str(first), "--json")


class Crowd:
    """People who do things at random."""

    def __init__(self, server: Served, context: BrowserContext, seed: int, tabs: int = TABS) -> None:
        self._server, self._random = server, random.Random(seed)
        self._tabs = [Tab(context.new_page(), None) for _ in range(tabs)]  # type: ignore[arg-type]
        for tab in self._tabs:
            self._load(tab)

    def _load(self, tab: Tab) -> None:
        tab.page.goto(f"{self._server.url}?fixedDpr=0.25")
        tab.page.wait_for_function(_READY)

    def use_all_once(self) -> None:
        """What is made when it is first needed, such as views from everywhere to find a robot by, or what only
        comparisons of planners use, is made then."""
        tab = self._tabs[0]
        tab.page.bring_to_front()
        tab.page.get_by_role("tab", name="Estimate").click()
        carry = tab.page.get_by_role("button", name="Kidnap the robot")
        # before the first flight a new machine compiles its kernels; a busy page may see its end before it can press
        end = time.monotonic() + 2 * PATIENCE_S
        while not self._pressed_at_once(carry):
            assert time.monotonic() < end, f"the robot cannot be kidnapped: {self._offers(tab)} is offered"
            if self._is_idle(tab):
                tab.page.keyboard.press("f")
            tab.page.wait_for_timeout(100)
        tab.page.wait_for_timeout(10_000)
        assert self._becomes_idle(tab, PATIENCE_S), "the flight goes on"
        tab.page.get_by_role("tab", name="Plan").click()
        tab.page.get_by_role("button", name="Compare planners").click()
        # the others have ended by then; the paper's may take minutes
        tab.page.get_by_text("with paper").first.wait_for(timeout=2000 * PATIENCE_S)
        tab.page.wait_for_timeout(5_000)
        assert self._becomes_idle(tab, PATIENCE_S), "the comparison goes on"

    def _pressed_at_once(self, button: Locator) -> bool:
        """Press a button in the moment in which it is found, if it is there: it may be gone in the next."""
        return button.evaluate_all("found => found.slice(0, 1).map(button => button.click()).length > 0")

    def open(self, place: str) -> None:
        """Open a place, and wait until it is there and nothing is done for it any more."""
        tab = self._tabs[0]
        tab.page.keyboard.press("Control+k")
        tab.page.get_by_placeholder("Search commands").fill(f"Open {place}")
        tab.page.locator(".mantine-Spotlight-actionLabel").filter(has_text=re.compile(f"^Open {place}$")).click()
        tab.page.wait_for_function(_IS_OPEN, arg=place)
        assert self._becomes_idle(tab, PATIENCE_S), f"{place} is not opened"
        # first plans, maps and pictures are still made then, and kept: in some rounds, not in others, for who goes on
        end, computed_s = time.monotonic() + PATIENCE_S, -math.inf
        while self._server.cpu_s() - computed_s > _AT_REST_S:
            assert time.monotonic() < end, f"{place} goes on computing"
            computed_s = self._server.cpu_s()
            tab.page.wait_for_timeout(1000)

    def act(self) -> str:
        """Do one thing in one tab; what it was."""
        tab = self._random.choice(self._tabs)
        action = self._random.choices(["key", "drag", "click", "turn", "reload"], [8, 4, 4, 2, 1])[0]
        try:
            getattr(self, f"_{action}")(tab)
        except Error as error:
            if not any(words in str(error) for words in _WENT_AWAY):
                raise
            return f"{action}, in vain"
        return action

    def _key(self, tab: Tab) -> None:
        tab.page.evaluate("document.activeElement?.blur()")
        tab.page.keyboard.press(self._random.choice(_KEYS))

    def _drag(self, tab: Tab) -> None:
        tab.drag_along_x(self._random.choice(list(EndRole)), self._random.uniform(-0.3, 0.3), GIZMO)

    def _click(self, tab: Tab) -> None:
        seen = [entry for entry in tab.page.get_by_role("button").all() if entry.is_visible()]
        buttons = [entry for entry in seen if entry.is_enabled(timeout=2000)]
        safe = [entry for entry in buttons if not any(word in entry.inner_text(timeout=2000) for word in _LEFT_OUT)]
        if safe:
            self._random.choice(safe).click(timeout=2000, force=True)

    def _turn(self, tab: Tab) -> None:
        self._random.choice(tab.page.get_by_role("tab").all()).click(timeout=2000)

    def _reload(self, tab: Tab) -> None:
        self._load(tab)

    def _is_idle(self, tab: Tab) -> bool:
        """Whether a page offers something to begin, and nothing to stop."""
        offers = self._offers(tab)
        return "Stop now" not in offers and any(_BEGINS.fullmatch(words) for words in offers)

    def _offers(self, tab: Tab) -> list[str]:
        """What stands on the buttons that are seen, all read in one moment: one by one they may go away meanwhile."""
        return tab.page.get_by_role("button").evaluate_all(_SEEN)

    def leave_quiet(self, patience_s: float) -> bool:
        """Stop what is running; whether it then ends."""
        self._load(self._tabs[0])
        return self._becomes_idle(self._tabs[0], patience_s)

    def _becomes_idle(self, tab: Tab, patience_s: float) -> bool:
        """Whether what is running ends when it is stopped."""
        end = time.monotonic() + patience_s
        while time.monotonic() < end:
            if self._is_idle(tab):
                return True
            tab.page.keyboard.press("x")
            tab.page.wait_for_timeout(500)
        print("still busy:", tab.page.locator("body").inner_text()[:400], file=sys.stderr)
        return False


def soak(server: Served, context: BrowserContext, actions: int, most_s: float, seed: int = 0) -> Account:
    """Do that many things, but stop after `most_s`, if it was enough by then to mean anything."""
    account = Account()
    page_complaints = complaints_of(context)
    crowd = Crowd(server, context, seed)
    crowd.use_all_once()
    began, noted = time.monotonic(), -np.inf
    for _ in range(actions):
        now = time.monotonic() - began
        if now > most_s and sum(account.actions.values()) >= LEAST_ACTIONS:
            break
        if now - noted > 5:
            noted = now
            account.memory_mb.append((round(now, 1), round(server.memory_mb(), 1)))
        done = crowd.act()
        account.actions[done] = account.actions.get(done, 0) + 1
    account.memory_mb.append((round(time.monotonic() - began, 1), round(server.memory_mb(), 1)))
    account.idle = crowd.leave_quiet(180)
    account.complaints = [*page_complaints, *server.complaints()]
    return account


@pytest.mark.slow
@pytest.mark.nightly
def test_two_minutes_of_hard_use_leave_no_error_no_job_and_little_memory(browser: Browser, tmp_path: Path) -> None:
    compile_kernels()
    with served("stonehenge", log=tmp_path / "server.log") as server:
        context = browser.new_context(viewport={"width": 800, "height": 560})
        account = soak(server, context, actions=150, most_s=75)
        context.close()
    assert not account.complaints, "\n\n".join(account.complaints)
    assert account.idle, "a job goes on that nobody can stop"
    assert len(account.actions) >= 3, account.actions
    # within the first minutes kernels, maps and pictures are still being made for the first time
    assert len(account.memory_mb) >= 3 and account.kept_mb(0, 35) < 3 * MOST_GROWTH_MB, account.memory_mb


@pytest.mark.slow
@pytest.mark.nightly
def test_places_opened_again_and_again_keep_no_memory(browser: Browser, tmp_path: Path) -> None:
    first, *others = scenes.with_fields()
    with served(first, log=tmp_path / "server.log") as server:
        context = browser.new_context(viewport={"width": 800, "height": 560})
        page_complaints, crowd = complaints_of(context), Crowd(server, context, 0, tabs=1)
        kept_mb = []
        for _ in range(4):
            for place in (*others, first):
                crowd.open(place)
            kept_mb.append(server.memory_mb())
        context.close()
    assert not [*page_complaints, *server.complaints()]
    # two rounds make what is kept of each place; what each later one kept would be kept by all after it
    assert kept_mb[3] - kept_mb[1] < 2 * MOST_OF_PLACES_MB, kept_mb


def main() -> None:
    """Soak for long, and tell."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--minutes", type=float, default=30)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--cores", type=int, default=2, help="on which the app runs")
    parser.add_argument("--log", type=Path, default=Path(tempfile.gettempdir()) / "soak.log", help="the server's log")
    asked = parser.parse_args()
    cores = set(sorted(os.sched_getaffinity(0))[: asked.cores])
    compile_kernels()
    with sync_playwright() as playwright, served("stonehenge", log=asked.log, cores=cores) as server:
        browser = launch(playwright)
        context = browser.new_context(viewport={"width": 800, "height": 560})
        account = soak(server, context, 10**6, 60 * asked.minutes, asked.seed)
        browser.close()
    growth = {"growth_mb": account.growth_mb(WARM_UP_S), "kept_mb": account.kept_mb(WARM_UP_S)}
    print(json.dumps({**growth, **vars(account)}))


if __name__ == "__main__":
    main()
