"""The panel in a real Chromium, beside a served board: what only a browser can show.

Skipped where Chromium and its driver are not installed, as on Debian by `apt install chromium chromium-driver`.
"""

import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import NamedTuple

import pytest

pytest.importorskip("nicegui", reason="the extra `panel` is not installed")
pytest.importorskip("selenium", reason="selenium is not installed")

from steptwin.host.cli.app import run
from tests.end_to_end.served import in_real_time
from tests.features.panel.page.browser import (
    AXE,
    CHROMIUM,
    DRIVER,
    NOT_SEEN,
    TIMEOUT_S,
    Browser,
    open_browser,
    panel_of,
    view_of,
)

pytestmark = pytest.mark.skipif(
    CHROMIUM is None or DRIVER is None, reason="Chromium and its driver are not installed: the panel is not tried in it"
)

NO_3D = "--disable-3d-apis"
"""Without a graphics card the 3D view would take most of a processor; one browser has it for a moment."""
STANDS = 0.01
"""Difference of two positions that is none."""
STOOD_S = 1.0
"""Time for which a joint has stood that has come to rest."""
STOPPED_BEFORE_DEG = 144.0
"""th2's range ends at 150 degrees: what rests farther out may have been stopped by that end."""
NEAR_ITS_SWITCHES = "-120 -140 5 -350"
"""Where the machine stands when it is switched on: homing is short."""
TABS = ("Jog", "Move", "Run", "Outputs", "Settings", "Result", "Hardware")
PHONE = (412, 915)
LIGHT_OR_DARK = """const button = document.querySelector('[aria-label="light or dark"]');
    button?.click(); return Boolean(button);"""


class Machine(NamedTuple):
    """A served board: its panel's address, and the folder in which it is recorded."""

    url: str
    recording: Path


@pytest.fixture(scope="module")
def machine(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Machine]:
    folder = tmp_path_factory.mktemp("panel")
    with panel_of("teaching-scara", folder, "--machine", f"stand-at={NEAR_ITS_SWITCHES}", "--out", "live") as url:
        yield Machine(url, folder / "live")


@pytest.fixture(scope="module")
def operator(machine: Machine) -> Iterator[Browser]:
    """Return the browser that operates the machine, which it has homed and seen drawn in 3D."""
    with open_browser() as browser:
        browser.open(machine.url)
        browser.until(lambda: browser.shows("Not homed: th1, th2, d3, th4."))
        assert browser.run("return document.querySelector('[data-live=q1]').textContent") == "unknown"
        browser.home()
        assert browser.run("return Boolean(document.querySelector('.arm-scene').armScene.shown)")
        browser.run("document.querySelector('[aria-label=\"switch the 3D view off or on\"]').click()")
        yield browser


@pytest.fixture(scope="module")
def watcher(machine: Machine, operator: Browser) -> Iterator[Browser]:
    """Return a second browser, as wide as a phone."""
    assert operator.shows("teaching-scara")
    with open_browser(PHONE, NO_3D) as browser:
        browser.open(machine.url)
        browser.resize(PHONE)
        yield browser


RELEASE = "document.dispatchEvent(new PointerEvent('pointerup', { bubbles: true }))"


def hold(browser: Browser, label: str) -> None:
    """Press a jog button and hold it until the joint moves.

    On a computer that is too slow for a beat every 250 ms the press dies, as it must; then press again.
    """
    before = browser.position(1)
    end_s = time.monotonic() + TIMEOUT_S
    moved = False
    while not moved:
        assert time.monotonic() < end_s, browser.run("return document.querySelector('[role=log]').innerText")
        browser.run(RELEASE)
        browser.run(
            """const button = document.querySelector(`[aria-label="${arguments[0]}"]`);
            const { left, top } = button.getBoundingClientRect();
            const press = { bubbles: true, button: 0, pointerId: 1, clientX: left + 3, clientY: top + 3 };
            button.dispatchEvent(new PointerEvent("pointerdown", press));""",
            label,
        )
        moved = browser.soon(lambda: abs(browser.position(1) - before) > 0.2, 4.0)


def comes_to_rest(browser: Browser) -> None:
    """Wait until the joint has stood for a second, by a page that sees the machine: a busy one shows old numbers."""
    end_s = time.monotonic() + TIMEOUT_S
    place, since_s = browser.position(1), time.monotonic()
    while time.monotonic() - since_s < STOOD_S:
        assert time.monotonic() < end_s, "it does not come to rest"
        time.sleep(0.1)
        before, place = place, browser.position(1)
        if abs(place - before) >= STANDS or browser.activity() == NOT_SEEN:
            since_s = time.monotonic()
    assert abs(place) < STOPPED_BEFORE_DEG, "it has come to rest at the end of its range"


def emergency_stopped(browser: Browser) -> bool:
    return browser.shows("Emergency stop: nothing moves until the reset.")


@contextmanager
def answers_later(browser: Browser, latency_ms: int) -> Iterator[None]:
    """Let the page get each answer of its server later."""

    def delay(latency_ms: int) -> None:
        throughput = {"downloadThroughput": -1, "uploadThroughput": -1}  # as it is
        conditions = {"offline": False, "latency": latency_ms, **throughput}
        browser.driver.execute_cdp_cmd("Network.emulateNetworkConditions", conditions)

    delay(latency_ms)
    try:
        yield
    finally:
        delay(0)


def foreign_requests(browser: Browser, url: str) -> list[str]:
    """Return what the page has asked other hosts for."""
    asked = browser.run("return performance.getEntriesByType('resource').map((entry) => entry.name)")
    assert len(asked) > 10
    return [name for name in asked if not name.startswith((url, url.replace("http", "ws"), "data:", "blob:"))]


def test_letting_go_and_losing_the_focus_end_a_jog(operator: Browser) -> None:
    for event in (
        RELEASE,
        "window.dispatchEvent(new Event('blur'))",
        "window.dispatchEvent(new Event('pagehide'))",
        "document.querySelector('.held').dispatchEvent(new PointerEvent('pointerout', { bubbles: true }))",
        "window.emitEvent = () => {}",  # the page falls silent, with the button still held
    ):
        hold(operator, "jog th2 forward")
        operator.run(event)
        comes_to_rest(operator)
    operator.driver.refresh()
    operator.until(lambda: operator.shows("you operate"))


def test_leaving_the_page_ends_a_jog_and_coming_back_goes_on_operating(
    machine: Machine, operator: Browser, watcher: Browser
) -> None:
    hold(operator, "jog th2 forward")
    operator.driver.get("about:blank")
    comes_to_rest(watcher)
    operator.open(machine.url)
    operator.until(lambda: operator.shows("you operate"))


def test_any_browser_stops_in_an_emergency_by_click_and_by_key(operator: Browser, watcher: Browser) -> None:
    from selenium.webdriver.common.keys import Keys

    def by_key() -> None:
        watcher.driver.switch_to.active_element.send_keys(Keys.ESCAPE)

    def by_click() -> None:
        watcher.driver.find_element("css selector", ".estop").click()

    watcher.until(lambda: watcher.shows("operates, you watch"))
    for stop in (by_click, by_key):
        hold(operator, "jog th2 backward")
        # On a busy computer the words may still tell of the first stop.
        operator.until(lambda: not emergency_stopped(operator))
        stop()
        operator.until(lambda: emergency_stopped(operator))
        try:
            comes_to_rest(operator)
            hold_again = "document.querySelector('[aria-label=\"jog th2 backward\"]').classList.contains('held')"
            operator.run(RELEASE)
            assert not operator.run(f"return {hold_again}")
        finally:  # or the tests after a failed one would find the machine held
            operator.click_until("Reset", lambda: not emergency_stopped(operator))


@in_real_time
def runs_through_a_reload(browser: Browser) -> None:
    """Let the machine run its job, and load the page again meanwhile."""
    if browser.shows("Fault:"):  # of an attempt before, on a computer that was too slow
        browser.click_until("Reset", lambda: not browser.shows("Fault:"))
    browser.tab("Run")
    browser.fill("cycles in one run", "6")
    browser.click("Preview")
    browser.until(lambda: browser.shows("It keeps all limits"))
    browser.click_until("Run", lambda: browser.activity().startswith("carry"))
    browser.until(lambda: browser.activity().startswith("carry") and not browser.activity().startswith("carry 0 %"))
    browser.driver.refresh()
    browser.until(lambda: browser.shows("you operate"))
    browser.until(lambda: browser.activity() == "")
    browser.tab("Result")
    browser.until(lambda: browser.shows("carry, run "))
    assert browser.shows("ended where planned")


def test_a_job_goes_on_through_a_reload_and_its_pulses_are_right(
    machine: Machine, operator: Browser, capsys: pytest.CaptureFixture[str]
) -> None:
    """The page says where each axis has ended; the recording has every pulse of the board, which goes on."""
    runs_through_a_reload(operator)
    run(["verify", str(machine.recording)])
    assert "its last motion had ended; so far it is right" in capsys.readouterr().out


def test_a_page_whose_words_stay_behind_loads_itself_again(operator: Browser, watcher: Browser) -> None:
    """Also where the page takes longer to come than the next figures, as on a slow computer."""
    with answers_later(operator, 1500):
        operator.run("window.nextMessageId = 1e9")  # what came before is not shown again: words are, numbers go on
        watcher.click("Stop")
        operator.until(lambda: operator.run("return window.nextMessageId < 1e9") is True)
    operator.until(lambda: operator.shows("you operate"))
    operator.until(lambda: operator.shows("stop by"))


def test_nothing_comes_from_another_host(machine: Machine, operator: Browser) -> None:
    assert foreign_requests(operator, machine.url) == []


def test_a_phone_shows_the_emergency_stop_first_and_all_of_the_width(watcher: Browser) -> None:
    for tab in TABS:
        watcher.tab(tab)
        width, shown, top = watcher.run(
            """const stop = document.querySelector(".estop").getBoundingClientRect();
            return [document.documentElement.scrollWidth, innerWidth, stop.top];"""
        )
        assert width <= shown == PHONE[0], tab
        assert top < 20


@pytest.mark.skipif(AXE is None, reason="axe-core-python is not installed: accessibility is not tried")
def test_no_view_has_a_serious_finding_of_axe_light_or_dark(operator: Browser) -> None:
    for theme, rule in enumerate((None, "color-contrast")):  # the second theme has other colours, and nothing else
        assert operator.lasting_findings(rule=rule) == [], theme
        for tab in TABS:
            operator.tab(tab)
            assert operator.lasting_findings(".q-tab-panel", rule) == [], (theme, tab)
        operator.dark()


def test_a_replay_asks_no_other_host_and_can_be_read(carry_run: Path, watcher: Browser, machine: Machine) -> None:
    with view_of(carry_run) as url:
        watcher.driver.get(url)
        watcher.until(lambda: watcher.shows("At the cursor"))
        assert foreign_requests(watcher, url) == []
        for _ in range(2 if AXE else 0):
            assert watcher.lasting_findings() == []
            watcher.until(lambda: bool(watcher.run(LIGHT_OR_DARK)))
    watcher.open(machine.url)


def test_a_frozen_and_a_killed_browser_end_their_jog(operator: Browser, watcher: Browser) -> None:
    """The last test of the file: the operator's browser is gone after it. The bench measures how soon it ends."""
    operator.tab("Jog")
    operator.driver.refresh()  # which opens the same tab again
    for number in (signal.SIGSTOP, signal.SIGKILL):
        operator.until(lambda: operator.shows("you operate"))
        hold(operator, "jog th2 forward")
        operator.signal(number)
        comes_to_rest(watcher)
        if number is signal.SIGSTOP:
            operator.signal(signal.SIGCONT)
