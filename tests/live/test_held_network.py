"""The panel in a real Chromium whose network is held up, or swallows what is sent: nothing moves late, no stop is lost.

Skipped where Chromium and its driver are not installed, as on Debian by `apt install chromium chromium-driver`.
"""

import os
import signal
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

pytest.importorskip("nicegui", reason="the extra `panel` is not installed")
pytest.importorskip("selenium", reason="selenium is not installed")

from steptwin.host.cli.app import run
from steptwin.host.client.links.bus_link import BusLink, Connection, open_bus
from steptwin.host.common.errors import BusError
from steptwin.host.operate.recovering import axis_states
from steptwin.host.operate.session import Session
from steptwin.host.robots import load_robot
from tests.features.panel.page.browser import (
    AXE,
    CHROMIUM,
    DRIVER,
    NOT_SEEN,
    Browser,
    descendants_of,
    open_browser,
    panel_of,
)
from tests.host.client.test_bus_link import free_port
from tests.live.held_network import HeldNetwork

pytestmark = pytest.mark.skipif(
    CHROMIUM is None or DRIVER is None, reason="Chromium and its driver are not installed: the panel is not tried in it"
)

ROBOT = "teaching-scara"
PORT = free_port()
"""Port of the board, which the tests talk to as another program does."""
ATTEMPTS = 10
HELD_S = 2.0
NO_3D = "--disable-3d-apis"
SHOWN = """return Boolean([...document.querySelectorAll("button")].find((button) =>
    button.innerText.trim().endsWith(arguments[0]) && button.offsetParent))"""
CLICK = """[...document.querySelectorAll("button")].find((button) =>
    button.innerText.trim().endsWith(arguments[0]) && button.offsetParent).click()"""


@pytest.fixture(scope="module")
def url(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    folder = tmp_path_factory.mktemp("held")
    with panel_of(ROBOT, folder, "--machine", "stand-at=-100 -100 5 -300", port=PORT) as address:
        yield address


@pytest.fixture
def network() -> Iterator[HeldNetwork]:
    with HeldNetwork() as made:
        yield made


@pytest.fixture
def browser(url: str, network: HeldNetwork) -> Iterator[Browser]:
    """A browser behind the network, which operates a machine that is switched on."""
    told("reset")
    with open_browser((1440, 1000), NO_3D, *network.flags) as made:
        made.open(url)
        made.operate()
        switch_on(made)
        yield made


def switch_on(browser: Browser) -> None:
    click_until(browser, "Switch on", "OPERATION ENABLED")


def click_until(browser: Browser, button: str, state: str) -> None:
    """Click until all axes have a state: a click is void that was made from what the page showed before a change."""
    browser.click_until(button, lambda: {found for found, _ in states()} == {state})
    browser.until(lambda: browser.activity() == "")


def told(command: str) -> None:
    """Run a command at the board; again if it does not answer in time, as on a busy computer."""
    assert any(run([command, ROBOT, "--connect", f"127.0.0.1:{PORT}"]) == 0 for _ in range(ATTEMPTS))


def states() -> list[tuple[str, float]]:
    """Return what the board itself says: the state and the position of each axis; ask again if it does not answer."""
    for _ in range(ATTEMPTS):
        with (
            suppress(BusError),
            BusLink(open_bus(Connection("socketcand", None, None, "127.0.0.1", PORT)), "the test") as link,
        ):
            session = Session(link, load_robot(ROBOT))
            return [(axis.state, axis.position) for axis in axis_states(session)]
    raise AssertionError(f"the board has not answered {ATTEMPTS} times")


def grey(browser: Browser) -> bool:
    return bool(browser.run("return document.body.classList.contains('silent')"))


def stop_line(browser: Browser) -> str:
    return str(browser.run("return document.querySelector('[data-stop-line]').textContent"))


def stays(expected: list[tuple[str, float]]) -> None:
    """See that the machine stands as it did, for longer than a command needs to begin."""
    end_s = time.monotonic() + 3.0
    while time.monotonic() < end_s:
        assert states() == expected
        time.sleep(0.2)


@pytest.mark.parametrize("grey_already", [False, True])
def test_a_click_that_the_network_held_up_moves_nothing(
    browser: Browser, network: HeldNetwork, grey_already: bool
) -> None:
    standing = states()
    network.hold()
    if grey_already:
        browser.until(lambda: grey(browser))
    browser.run(CLICK, "Home all")
    time.sleep(HELD_S)
    network.release()
    browser.until(lambda: not grey(browser))
    stays(standing)
    if not grey_already:  # in grey the button is dead: nothing was sent
        browser.until(lambda: browser.shows("home: too late: the page had shown the machine of"))
    browser.click_until("Home all", lambda: browser.activity() not in ("", NOT_SEEN))  # the page is alive again
    browser.click("Stop")
    browser.until(lambda: browser.activity() == "")


def test_a_reset_that_the_network_held_up_ends_no_later_emergency_stop(
    browser: Browser, network: HeldNetwork, capsys: pytest.CaptureFixture[str]
) -> None:
    told("estop")
    browser.until(lambda: browser.run(SHOWN, "Reset"))  # later than the words beside it, on a busy computer
    network.hold()
    browser.run(CLICK, "Reset")
    told("estop")
    time.sleep(HELD_S)
    network.release()
    browser.until(lambda: not grey(browser))
    stays(states())
    assert {state for state, _ in states()} == {"FAULT"}
    capsys.readouterr()


def test_a_click_from_before_a_stop_and_a_reset_elsewhere_moves_nothing(browser: Browser, network: HeldNetwork) -> None:
    network.hold()
    browser.run(CLICK, "Home all")
    told("estop")
    told("reset")
    standing = states()
    network.release()
    browser.until(lambda: not grey(browser))
    stays(standing)
    assert {state for state, _ in standing} == {"SWITCH ON DISABLED"}


@pytest.mark.parametrize("how", ["click", "key"])
def test_an_emergency_stop_on_a_dead_socket_is_obeyed(browser: Browser, network: HeldNetwork, how: str) -> None:
    from selenium.webdriver.common.keys import Keys

    network.swallow(new=False)
    if how == "click":
        browser.driver.find_element("css selector", ".estop").click()
    else:
        browser.driver.switch_to.active_element.send_keys(Keys.ESCAPE)
    browser.until(lambda: all(state == "FAULT" for state, _ in states()))


def test_a_button_that_does_not_work_says_so(browser: Browser, network: HeldNetwork, tmp_path: Path) -> None:
    network.swallow(new=True)
    browser.driver.find_element("css selector", ".estop").click()
    browser.until(
        lambda: stop_line(browser) == "E-STOP: no connection: this button does not work, use the machine's own switch."
    )
    browser.until(lambda: browser.shows("no connection to the panel"))
    head = browser.run("return document.querySelector('.panel-header').innerText")
    assert "you operate" not in head
    assert "enabled" not in head
    browser.picture(tmp_path / "dead.png")
    assert {state for state, _ in states()} == {"OPERATION ENABLED"}


def test_a_stop_that_is_obeyed_is_said(browser: Browser) -> None:
    browser.driver.find_element("css selector", ".estop").click()
    browser.until(lambda: stop_line(browser) == "Emergency stop obeyed: all drives are off and held.")
    click_until(browser, "Reset", "SWITCH ON DISABLED")
    browser.until(lambda: stop_line(browser) == "")


def test_a_page_whose_panel_was_killed_says_nothing_old(browser: Browser, tmp_path: Path) -> None:
    """The last test of the file: the panel is gone after it."""
    panels = [
        each for each in descendants_of(os.getpid()) if b"panel.served" in Path(f"/proc/{each}/cmdline").read_bytes()
    ]
    assert len(panels) == 1
    os.kill(panels[0], signal.SIGKILL)
    browser.until(lambda: browser.shows("no connection to the panel"))
    assert not browser.shows("you operate")
    for _ in range(2 if AXE else 0):  # what is grey can be read, in light and in dark
        assert browser.lasting_findings(rule="color-contrast") == []
        browser.dark()
    assert stop_line(browser).startswith("No connection to the panel: what is shown is old. E-STOP may not work: ")
    browser.driver.find_element("css selector", ".estop").click()
    browser.until(lambda: stop_line(browser).startswith("E-STOP: no connection: this button does not work"))
    browser.picture(tmp_path / "killed.png")
