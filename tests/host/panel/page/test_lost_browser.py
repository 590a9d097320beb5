"""A browser that freezes or is killed while it holds a jog button: the machine stands half a second later.

Skipped where Chromium and its driver are not installed, as `test_browser.py`.
"""

import os
import signal
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("nicegui", reason="the extra `panel` is not installed")
pytest.importorskip("selenium", reason="selenium is not installed")

from steptwin.bench import panel_page
from steptwin.bench.live_server import Server, serving
from steptwin.bench.panel import Observer
from tests.emulator.live_rig import await_true
from tests.end_to_end.served import in_real_time
from tests.host.panel.page.browser import CHROMIUM, DRIVER, Browser, open_browser

pytestmark = pytest.mark.skipif(
    CHROMIUM is None or DRIVER is None, reason="Chromium and its driver are not installed: the panel is not tried in it"
)

ROBOT = "lab-scara"
LOST_S = 0.5
HELD = "return document.querySelector('[aria-label=\"jog th2 forward\"]').classList.contains('held')"
PRESS = """const button = document.querySelector('[aria-label="jog th2 forward"]');
const { left, top } = button.getBoundingClientRect();
button.dispatchEvent(new PointerEvent("pointerdown",
    { bubbles: true, button: 0, pointerId: 1, clientX: left + 3, clientY: top + 3 }));"""


@pytest.fixture(scope="module")
def served() -> Iterator[Server]:
    with serving("steptwin", "serve", ROBOT, "--port", "0", "--json") as server:
        yield server


@pytest.fixture(scope="module")
def observer(served: Server) -> Iterator[Observer]:
    """Return a client of the bus that sees when axes come to rest."""
    seeing = Observer(served)
    yield seeing
    seeing.close()


@pytest.fixture(scope="module")
def url(served: Server) -> Iterator[str]:
    with panel_page.panel("panel", ROBOT, "--connect", f"127.0.0.1:{served.port}", "--port", "0") as opened:
        yield opened.url


def processes_of(driver_id: int) -> list[int]:
    """Return the processes that a browser's driver has started, and those that they have."""
    children: dict[int, list[int]] = {}
    for place in Path("/proc").glob("[0-9]*/stat"):
        try:
            parent_id = int(place.read_text().rpartition(")")[2].split()[1])
        except (FileNotFoundError, ProcessLookupError):
            continue
        children.setdefault(parent_id, []).append(int(place.parent.name))
    found, new = [], [driver_id]
    while new:
        new = [child for parent_id in new for child in children.get(parent_id, [])]
        found += new
    return found


def standstill_s(browser: Browser, observer: Observer, signal_number: signal.Signals) -> float:
    """Hold a button, then stop or kill every process of the browser; return the time until the machine stands."""
    browser.until(lambda: browser.shows("you operate"))
    browser.run(PRESS)
    browser.until(lambda: observer.moving)
    time.sleep(0.3)
    assert observer.moving
    assert browser.run(HELD)
    lost_s = time.monotonic()
    for process_id in processes_of(browser.driver.service.process.pid):
        os.kill(process_id, signal_number)
    await_true(lambda: not observer.moving, "standstill")
    return observer.rest_s - lost_s


@in_real_time
def test_a_frozen_and_a_killed_browser_end_their_jog_at_once(url: str, observer: Observer) -> None:
    with open_browser((1440, 1000), "--disable-3d-apis") as browser:
        browser.open(url)
        assert standstill_s(browser, observer, signal.SIGSTOP) < LOST_S
        for process_id in processes_of(browser.driver.service.process.pid):
            os.kill(process_id, signal.SIGCONT)
        browser.driver.refresh()
        assert standstill_s(browser, observer, signal.SIGKILL) < LOST_S
