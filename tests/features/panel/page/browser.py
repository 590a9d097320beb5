"""A real Chromium at a real panel, for the tests that need one and for the pictures in the documentation."""

import os
import re
import shutil
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any, Final

from tests.end_to_end.command_line import PROGRAM

CHROMIUM: Final = shutil.which("chromium")
DRIVER: Final = shutil.which("chromedriver")
_AXE: Final = find_spec("axe_core_python")
AXE: Final = Path(_AXE.origin).parent / "axe.min.js" if _AXE and _AXE.origin else None
"""The rules of accessibility that programs can check, as one script; None where the package is not installed."""
_FLAGS: Final = (
    "--headless=new",
    "--no-sandbox",  # in containers, as in CI, the user is root
    "--disable-dev-shm-usage",
    "--disable-gpu",  # without a graphics card, drawing the page as one would take a processor for each browser
    "--enable-unsafe-swiftshader",  # but the 3D view is drawn, in software
)
TIMEOUT_S: Final = 120.0
"""For the page, the browser and each script in it, on a busy computer."""

AGAIN_S: Final = 4.0
"""Time after which a user presses a button again that has changed nothing."""
LOOKS: Final = 15
"""Looks by axe after which a finding is one: messages are gone after 6 s."""
NOT_SEEN: Final = "not seen"


class Browser:
    """A browser with one page of the panel."""

    def __init__(self, driver: Any) -> None:
        self.driver = driver

    def open(self, url: str) -> None:
        """Open a panel and wait until it shows the machine."""
        self.driver.get(url)
        self.until(lambda: bool(self.run("return document.querySelector('[data-live=q0]')?.textContent")))

    def run(self, script: str, *arguments: Any) -> Any:
        """Run JavaScript in the page."""
        return self.driver.execute_script(script, *arguments)

    def soon(self, condition: Callable[[], bool], timeout_s: float) -> bool:
        """Wait until something is so; return False if it is not in time."""
        end_s = time.monotonic() + timeout_s
        while not condition():
            if time.monotonic() > end_s:
                return False
            time.sleep(0.05)
        return True

    def until(self, condition: Callable[[], bool], timeout_s: float = TIMEOUT_S) -> None:
        """Wait until something is so; AssertionError with the page's text if it never is."""
        assert self.soon(condition, timeout_s), self.run("return document.body.innerText")

    def shows(self, text: str) -> bool:
        """Return whether the page shows a text."""
        return bool(self.run("return document.body.innerText.includes(arguments[0])", text))

    def tab(self, name: str) -> None:
        """Open a tab, and wait until it is shown: the page asks its server for it."""
        click = "[...document.querySelectorAll('.q-tab')].find(e => e.innerText.trim() === arguments[0]).click()"
        shown = 'return Boolean(document.querySelector(`.q-tab-panel[aria-label="${arguments[0]}"]`)?.offsetParent)'

        def opened() -> bool:
            self.run(click, name)
            return self.soon(lambda: bool(self.run(shown, name)), AGAIN_S)

        self.until(opened)

    def click(self, text: str) -> None:
        """Click the first button that is shown with this text and enabled, as soon as there is one."""
        script = """const found = [...document.querySelectorAll("button")].find((button) =>
            button.innerText.trim().endsWith(arguments[0]) && button.offsetParent && !button.disabled);
            found?.click(); return Boolean(found);"""
        self.until(lambda: bool(self.run(script, text)))

    def click_until(self, text: str, condition: Callable[[], bool]) -> None:
        """Click a button that changes the machine, and again until something is so.

        A click on a page that does not see the machine is void, as is one that comes late: both occur on a busy one.
        """

        def clicked() -> bool:
            if condition():
                return True
            if self.activity() != NOT_SEEN:
                self.click(text)
            return self.soon(condition, AGAIN_S)

        self.until(clicked)

    def operate(self) -> None:
        """Take the operator's place, by the button that the page offers once no other page operates."""
        script = """[...document.querySelectorAll("button")].find((button) =>
            button.innerText.trim() === "Operate" && button.offsetParent)?.click();"""

        def operates() -> bool:
            if not self.shows("you operate"):
                self.run(script)
            return self.soon(lambda: self.shows("you operate"), AGAIN_S)

        self.until(operates)

    def fill(self, label: str, text: str) -> None:
        """Write into the first field that is shown with this label, as soon as there is one."""
        from selenium.webdriver.common.keys import Keys

        script = """return [...document.querySelectorAll("input")].find((input) =>
            input.getAttribute("aria-label") === arguments[0] && input.offsetParent);"""
        self.until(lambda: bool(self.run(script, label)))  # a tab that was opened is shown a little later
        field = self.run(script, label)
        field.send_keys(Keys.CONTROL, "a")
        field.send_keys(text, Keys.TAB)

    def findings(self, part: str | None = None, rule: str | None = None) -> list[str]:
        """Return what axe-core finds serious or critical in the page, by all rules or by one.

        With `part`, a selector, it looks only there.
        """
        assert AXE is not None
        if not self.run("return Boolean(window.axe)"):
            self.run(AXE.read_text(encoding="utf-8"))
        script = """const [part, rule, done] = arguments;
            const options = { resultTypes: ["violations"], ...(rule && { runOnly: [rule] }) };
            axe.run(part || document, options).then((found) => done(found.violations
                .filter((each) => ["serious", "critical"].includes(each.impact))
                .map((each) => `${each.id}: ${each.nodes.map((node) => node.html.slice(0, 150)).join(" | ")}`)),
                (error) => done([`${error}`]));"""
        return [str(finding) for finding in self.driver.execute_async_script(script, part, rule)]

    def lasting_findings(self, part: str | None = None, rule: str | None = None) -> list[str]:
        """Return the findings of the last of LOOKS looks: colours fade, and on a busy computer a look takes seconds."""
        for _ in range(LOOKS):
            found = self.findings(part, rule)
            if not found:
                break
            time.sleep(0.5)
        return found

    def position(self, joint: int) -> float:
        """Return a joint's position, as the page shows it."""
        return float(self.run("return document.querySelector(`[data-live=q${arguments[0]}]`).textContent", joint))

    def home(self, timeout_s: float = TIMEOUT_S) -> None:
        """Home all joints, and wait until the machine does nothing."""
        self.click_until("Home all", lambda: self.activity() not in ("", NOT_SEEN))
        self.until(lambda: self.activity() == "", timeout_s)

    def activity(self) -> str:
        """Return what the machine does, as the head says; empty while it rests, NOT_SEEN where a page cannot know."""
        script = """const said = document.querySelector("[data-activity]");
            if (document.querySelector("body.silent, .unseen")) return arguments[0];
            return said.offsetParent ? said.innerText : "";"""
        return str(self.run(script, NOT_SEEN))

    def dark(self) -> None:
        """Change between light and dark."""
        self.run("document.querySelector('[data-theme-switch]').click()")

    def resize(self, size: tuple[int, int]) -> None:
        """Change the size of the page itself."""
        width, height = size
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": True}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)

    def signal(self, number: int) -> None:
        """Send a signal to every process of the browser, but not to its driver."""
        for process_id in descendants_of(self.driver.service.process.pid):
            os.kill(process_id, number)

    def picture(self, path: Path) -> None:
        """Save what is seen."""
        self.driver.save_screenshot(str(path))


def children_of(process_id: int) -> list[int]:
    """Return the processes that a process has started."""
    return _children().get(process_id, [])


def descendants_of(process_id: int) -> list[int]:
    """Return the processes that a process has started, and those that they have."""
    children = _children()
    found, new = list[int](), [process_id]
    while new:
        new = [child for parent in new for child in children.get(parent, [])]
        found += new
    return found


def _children() -> dict[int, list[int]]:
    children: dict[int, list[int]] = {}
    for place in Path("/proc").glob("[0-9]*/stat"):
        with suppress(FileNotFoundError, ProcessLookupError):  # it has just ended
            children.setdefault(int(place.read_text().rpartition(")")[2].split()[1]), []).append(int(place.parent.name))
    return children


@contextmanager
def open_browser(size: tuple[int, int] = (1440, 1000), *flags: str) -> Iterator[Browser]:
    """Open Chromium, and end it after the block."""
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = CHROMIUM or ""
    for flag in (*_FLAGS, *flags, f"--window-size={size[0]},{size[1]}"):
        options.add_argument(flag)
    driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(DRIVER))
    driver.set_script_timeout(TIMEOUT_S)
    try:
        yield Browser(driver)
    finally:
        driver.quit()


@contextmanager
def panel_of(robot: str, folder: Path, *options: str, port: int = 0) -> Iterator[str]:
    """Serve a robot's board, at a free port by default, with its panel, in a folder; yield the page's address.

    At the page's usual port the browser of another run, or of a user, might still look for its own panel.
    """
    with _page_of(folder, "panel", "serve", robot, "--panel-port", "0", "--port", str(port), *options) as url:
        yield url


@contextmanager
def view_of(*folders: Path) -> Iterator[str]:
    """Show stored runs; yield the page's address."""
    with _page_of(folders[0], "view", "view", *map(str, folders), "--port", "0") as url:
        yield url


@contextmanager
def _page_of(folder: Path, name: str, *words: str) -> Iterator[str]:
    """Run a command in a folder that prints a page's address under a name; yield it."""
    with (
        TemporaryFile("w+") as errors,
        subprocess.Popen([*PROGRAM, *words], stdout=subprocess.PIPE, stderr=errors, text=True, cwd=folder) as process,
    ):
        try:
            assert process.stdout
            addresses = (re.match(rf"{name}: (\S+)", line) for line in process.stdout)
            address = next((found[1] for found in addresses if found), None)
            errors.seek(0)
            assert address is not None, errors.read()
            yield address
        finally:
            process.terminate()  # it ends the panel, too
            process.wait(TIMEOUT_S)
